"""Messages of what cannot be, in the units of the screen."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from linkjax._display import Numbers, prefixed, short
from linkjax._results import MachineError
from linkjax._units import display_units, unit_of
from linkjax.scenes import SceneError, load_document, overridden

NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
AMOUNT = re.compile(rf"(?<![\w.])({NUMBER})(?: to ({NUMBER}))? (m|rad|degrees)(?![\w/^²])")
QUOTED = re.compile(r"""("[^"]*"|(?<!\w)'[^']*')""")


def units_for(name: str, changes: Mapping[str, Any], units: str) -> str:
    """The units asked for, and where none of a speed of rotation is among them that in which the scene gives its
    speed. Raises `QuantityError` for what is no unit."""
    if "rad/s" in display_units(units):
        return units
    given = unit_of(overridden(load_document(name), changes).table.get("speed"))
    return ", ".join(part for part in (units, given) if part)


@contextmanager
def messages_in(show: Numbers) -> Iterator[None]:
    """What is raised inside says its lengths, angles and speeds in these units; what is wrong with a scene file only
    where a unit of length was chosen."""
    try:
        yield
    except MachineError as error:
        message = str(error)
        for text, speed in error.speeds:
            message = message.replace(text, show.bound(speed, "rad/s"), 1)
        raise MachineError(retold(message, show), error.result) from error
    except SceneError as error:
        if "m" not in show.units:
            raise
        problem, remedy = retold(error.problem, show), retold(error.remedy, show)
        raise SceneError(error.source, error.key, error.value, problem, remedy) from error


def retold(message: str, show: Numbers) -> str:
    """A message with its lengths and angles in other units; what stands in quotes is left as it is."""
    parts = QUOTED.split(message)
    return "".join(part if i % 2 else AMOUNT.sub(lambda found: _amount(found, show), part)
                   for i, part in enumerate(parts))  # fmt: skip


def _amount(found: re.Match[str], show: Numbers) -> str:
    texts = [text for text in found.groups()[:2] if text is not None]
    values, unit = [float(text) for text in texts], found[3]
    if unit == "degrees":
        if "rad" not in show.units:
            return found[0]
        values = [math.radians(value) for value in values]
    size = max(abs(value) for value in values)
    factor, label = prefixed(size, "m", show.units) if unit == "m" else show.units.get("rad", (180 / math.pi, "°"))
    digits = max(4, *(len(text.partition("e")[0].lstrip("-0.").replace(".", "")) for text in texts))
    told = " to ".join(short(float(f"{factor * value:.{digits}g}")) for value in values)
    return f"{told}{'' if label == '°' else ' '}{label}"
