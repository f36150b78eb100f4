"""Checks of windows that are given by what happens."""

from __future__ import annotations

from linkjax._units import nearest
from linkjax.loads import Passage
from linkjax.mechanism import Mechanism, StructureError


def check_passage(element: str, mechanism: Mechanism, window: Passage) -> None:
    """Raise `StructureError` unless the point or link of the window exists and moves, and the point has a direction."""
    if window.link:
        if window.link not in mechanism.links:
            raise StructureError(element, f"link {window.link!r} is not defined", nearest(window.link, mechanism.links))
        if window.link in {link for group in mechanism.groups for link in group.translating()}:
            problem = f"link {window.link!r} never turns, so the window has no beginning"
            raise StructureError(element, problem, "name a point of this link, or another link")
        return
    point, known = window.point, {name for link in mechanism.links for name in mechanism.points_on(link)}
    if point in mechanism.fixed:
        problem = f"point {point!r} never moves, so the window has no beginning"
        raise StructureError(element, problem, "name another point")
    if point not in known:
        raise StructureError(element, f"point {point!r} is not defined", nearest(point, known))
    guides = len(mechanism.guides_of(point))
    if window.direction is None and guides != 1:
        problem = f"point {point!r} is on {'several sliders' if guides else 'no slider'}, so its position has no "
        remedy = 'add the direction of its coordinate, direction = "x", "y" or an angle such as "30 deg"'
        raise StructureError(element, f"{problem}direction", remedy)
