"""What measures need of the structure of a scene, found once for a structure: names of elements, and guides."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax

from linkjax.forces import other_sides
from linkjax.groups import Guide
from linkjax.machine import Scene

Elements = tuple[str, ...]
MOST = 64  # structures of which is remembered what follows from them


def by_structure(function: Callable[[Scene], Any]) -> Callable[[Scene], Any]:
    """A function of what a scene is made of, not of its numbers, computed once for a structure."""
    known: dict[Any, Any] = {}

    def remembered(scene: Scene) -> Any:
        key = jax.tree.structure((scene.mechanism, scene.friction))
        if key not in known:
            if len(known) >= MOST:
                known.clear()
            known[key] = function(scene)
        return known[key]

    return remembered


@by_structure
def sliding_points(scene: Scene) -> Elements:
    """The points of sliders."""
    mechanism = scene.mechanism
    return tuple(name for name in mechanism.owners() if mechanism.guides_of(name))


@by_structure
def guided(scene: Scene) -> dict[str, tuple[int, int]]:
    """Number of the group and of its slot of every sliding joint, by its elements, "<block>.guide.<link>"."""
    found, sides = {}, other_sides(scene)
    for i, group in enumerate(scene.mechanism.groups):
        slots = {slot.block: j for j, slot in enumerate(group.sliding())}
        for joint in group.joints():
            if joint.slides and joint.link in slots:
                found |= {f"{joint.name}.{link}": (i, slots[joint.link]) for link in sides[joint.name]}
    return found


def guides(scene: Scene, names: Elements) -> dict[str, Guide]:
    """The guides of those of these elements that are in a sliding joint."""
    groups, numbers = scene.mechanism.groups, guided(scene)
    return {name: groups[i].sliding()[j].guide for name, (i, j) in numbers.items() if name in names}
