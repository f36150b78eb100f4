"""Error messages in the display units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from linkjax._display import Numbers, retold
from linkjax._results import MachineError
from linkjax._units import display_units, unit_of
from linkjax.scenes import SceneError, load_document, overridden


def units_for(name: str, changes: Mapping[str, Any], units: str) -> str:
    """The units of `--units`, with the unit of the speed in the scene if they have none for a speed of rotation.
    Raises `QuantityError` for an unknown unit."""
    if "rad/s" in display_units(units):
        return units
    given = unit_of(overridden(load_document(name), changes).table.get("speed"))
    return ", ".join(part for part in (units, given) if part)


@contextmanager
def messages_in(show: Numbers) -> Iterator[None]:
    """Errors raised inside show lengths, angles and speeds in these units. Errors of a scene file do so only if a unit
    of length was chosen."""
    try:
        yield
    except MachineError as error:
        raise MachineError(retold(str(error), show), error.result) from error
    except SceneError as error:
        if "m" not in show.units:
            raise
        problem, remedy = retold(error.problem, show), retold(error.remedy, show)
        raise SceneError(error.source, error.key, error.value, problem, remedy) from error
