"""Checks of loads that are given over a coordinate, or act along a guide."""

from __future__ import annotations

from typing import Any

from linkjax._units import nearest
from linkjax.loads import AbstractLoad, Coordinate, Diagram, Gas, Table
from linkjax.mechanism import Mechanism, StructureError


def check_table(element: str, mechanism: Mechanism, cycle: float, load: AbstractLoad) -> None:
    """Raise `StructureError` unless the period of a table fits the cycle, its coordinate changes and has a direction,
    and the piston of a gas load is on a guide of the frame."""
    table: Any = load if isinstance(load, Table) else load.pressure if isinstance(load, Gas) else None
    over_crank = table.over is None if isinstance(table, Table) else isinstance(table, Diagram) and not table.by_volume
    if over_crank and abs(cycle / table.period - round(cycle / table.period)) > 1e-9:
        problem = f"the cycle of {cycle:.9g} rad is not a multiple of the period of the table, {table.period:.9g} rad"
        remedy = "set cycle_turns of the scene to the number of turns after which all loads repeat"
        raise StructureError(element, problem, remedy)
    if isinstance(load, Table):
        if load.over is not None:
            _check_coordinate(element, mechanism, load.over)
        if load.point and load.direction is None:
            _check_guide(element, mechanism, load.point, 'add the direction of the force, "x", "y" or an angle')
    if isinstance(load, Gas):
        _check_guide(element, mechanism, load.point, "name a point of one slider, the piston")
        if mechanism.guides_of(load.point)[0].on != "frame":
            problem = f"the guide of {load.point!r} is on a moving link, and the gas would push this link"
            remedy = "write a table of forces instead, or a cylinder on the frame"
            raise StructureError(element, problem, remedy)


def _check_coordinate(element: str, mechanism: Mechanism, over: Coordinate) -> None:
    if over.link:
        if over.link not in mechanism.links:
            raise StructureError(element, f"link {over.link!r} is not defined", nearest(over.link, mechanism.links))
        if over.link in {link for group in mechanism.groups for link in group.translating()}:
            problem = f"link {over.link!r} never turns, so there is no table over its angle"
            raise StructureError(element, problem, "name a point of this link, or another link")
        return
    if over.point in mechanism.fixed:
        problem = f"point {over.point!r} never moves, so there is no table over its position"
        raise StructureError(element, problem, "name another point")
    known = {name for link in mechanism.links for name in mechanism.points_on(link)}
    if over.point not in known:
        raise StructureError(element, f"point {over.point!r} is not defined", nearest(over.point, known))
    if over.direction is None:
        remedy = 'add the direction of its coordinate, direction = "x", "y" or an angle such as "30 deg"'
        _check_guide(element, mechanism, over.point, remedy)


def _check_guide(element: str, mechanism: Mechanism, point: str, remedy: str) -> None:
    """Raise `StructureError` unless a point belongs to exactly one slider."""
    guides = len(mechanism.guides_of(point))
    if guides != 1:
        where = "several sliders" if guides else "no slider"
        raise StructureError(element, f"point {point!r} is on {where}, so it has no guide to follow", remedy)
