"""Messages of what cannot be, in the units of the screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from linkjax._display import Numbers, retold
from linkjax._results import MachineError
from linkjax._units import display_units, unit_of
from linkjax.scenes import SceneError, load_document, overridden


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
        raise MachineError(retold(str(error), show), error.result) from error
    except SceneError as error:
        if "m" not in show.units:
            raise
        problem, remedy = retold(error.problem, show), retold(error.remedy, show)
        raise SceneError(error.source, error.key, error.value, problem, remedy) from error
