"""The numbers of a scene by name, as an optimiser frees them: `links.rod.length`, `fixed.F.x`, `flywheel.inertia`.

Names follow the keys of scene files; a place on a link has `along` and `across`, a point of the frame `x` and `y`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.groups import AbstractGroup, AbstractLaw, Belt, Drive, General, Guide, LinearDriver, Rack, Slot, Teeth
from linkjax.loads import AbstractLoad
from linkjax.machine import Scene
from linkjax.mechanism import Link

Where = Callable[[Scene], Any]

UNITS = {
    "length": "m", "mass": "kg", "inertia": "kg m^2", "along": "m", "across": "m", "x": "m", "y": "m", "area": "m^2",
    "density": "kg/m^3", "thickness": "m", "offset": "m", "speed": "rad/s", "angle": "rad", "torque": "N m",
    "force": "N", "radius": "m", "other": "m", "start": "m", "tension": "N", "phase": "rad", "slot": "rad",
    "pressure_angle": "rad",
}  # fmt: skip
LEAST = {
    "inertia": 0.0,
    "thickness": 1e-6,
    "density": 1.0,
    "radius": 1e-6,
    "other": 1e-6,
    "tension": 0.0,
    "pressure_angle": 0.0,
}  # discs have a radius


@dataclasses.dataclass(frozen=True)
class Number:
    """One number of a scene: where it is in the tree, its unit, and the least it may be."""

    name: str
    where: Where
    unit: str
    least: float = -math.inf

    def read(self, scene: Scene) -> Array:
        """Its value in a scene (SI)."""
        return self.where(scene)


class DesignError(ValueError):
    """Something asked of an optimisation that cannot be; the message names the element and the remedy."""

    def __init__(self, element: str, problem: str, remedy: str):
        self.element, self.problem, self.remedy = element, problem, remedy
        super().__init__(f"{element}: {problem}; {remedy}")


def numbers(scene: Scene) -> dict[str, Number]:
    """Every number of a scene that may be freed, by name."""
    return {number.name: number for number in _numbers(scene)}


def number(scene: Scene, name: str) -> Number:
    """The number of this name. Raises `DesignError` with the nearest known one."""
    known = numbers(scene)
    if name not in known:
        inner = [other for other in known if other.startswith(f"{name}.")]
        hint = f"it has: {', '.join(inner)}" if inner else nearest(name, known)
        raise DesignError(name, "is no number of this scene", hint)
    return known[name]


def changed(scene: Scene, values: Mapping[str, Any] | Sequence[tuple[Number, Any]]) -> Scene:
    """The scene with numbers replaced, by name or by `Number`; differentiable in the values."""
    pairs = [(number(scene, k), v) for k, v in values.items()] if isinstance(values, Mapping) else list(values)
    if not pairs:
        return scene
    new = [jnp.asarray(value, dtype=at.read(scene).dtype) for at, value in pairs]
    return eqx.tree_at(lambda tree: [at.where(tree) for at, _ in pairs], scene, new)


def _numbers(scene: Scene) -> Iterator[Number]:
    bars = {link for group in scene.mechanism.groups for link, (_, far) in group.pins().items() if far is not None}
    for point in scene.mechanism.fixed:
        yield from _vec(f"fixed.{point}", lambda s, p=point: s.mechanism.fixed[p], ("x", "y"))
    for name, link in scene.mechanism.links.items():
        yield from _link(f"links.{name}", link, lambda s, n=name: s.mechanism.links[n], name in bars)
    yield Number("flywheel.inertia", lambda s: s.mechanism.flywheel.inertia, "kg m^2", 0.0)
    for i, group in enumerate(scene.mechanism.groups):
        yield from _group(f"groups.{'-'.join(group.link_names())}", group, lambda s, i=i: s.mechanism.groups[i])
    for i, load in enumerate(scene.loads):
        yield from _load(f"loads.{load.name}", load, lambda s, i=i: s.loads[i])
    yield Number("speed", lambda s: s.speed, "rad/s", 0.0)
    yield from _vec("gravity", lambda s: s.gravity, ("x", "y"), "m/s^2")


def _vec(name: str, where: Where, parts: tuple[str, str] = ("along", "across"), unit: str = "m") -> Iterator[Number]:
    yield Number(f"{name}.{parts[0]}", lambda s: where(s).x, unit)
    yield Number(f"{name}.{parts[1]}", lambda s: where(s).y, unit)


def _link(name: str, link: Link, where: Where, bar: bool) -> Iterator[Number]:
    given = ("area", "density") if link.mass_properties == "section" else ("mass", "inertia")
    for key in (*(("length",) if bar else ()), *given):
        yield Number(f"{name}.{key}", lambda s, k=key: getattr(where(s), k), UNITS[key], 0.0)
    if link.mass_properties != "section":
        yield from _vec(f"{name}.centre", lambda s: where(s).centre)
    for point in link.points:
        yield from _vec(f"{name}.points.{point}", lambda s, p=point: where(s).points[p])
    for key, piece in link.counterweights.items():
        own = f"{name}.counterweights.{key}"
        yield Number(f"{own}.mass", lambda s, k=key: where(s).counterweights[k].mass, "kg", 0.0)
        yield from _vec(f"{own}.at", lambda s, k=key: where(s).counterweights[k].at)
        for part in ("inertia", "thickness", "density"):
            if getattr(piece, part) is not None:
                yield Number(f"{own}.{part}", lambda s, k=key, q=part: getattr(where(s).counterweights[k], q),
                             UNITS[part], LEAST[part])  # fmt: skip


def _group(
    name: str, group: AbstractGroup | Guide | Drive | Slot, where: Where, slides: bool = False
) -> Iterator[Number]:
    """The numbers of a group, of its guides and of its drive, by the keys of a scene file; `slides` says whether the
    drive does."""
    slides = (
        slides or isinstance(group, LinearDriver) or (isinstance(group, General) and group.driven_slot() is not None)
    )
    rack = isinstance(group, Rack) and ".gears[" in name  # its guide is that of a slot
    for field in dataclasses.fields(group):
        value = getattr(group, field.name)
        if field.name == "path" or (rack and field.name == "guide") or (field.name == "phase" and slides):
            continue  # no number of the design, or of no effect
        if isinstance(value, AbstractLaw):
            unit = "m" if slides else "rad"
            yield from _law(f"{name}.{field.name}", value, lambda s, f=field.name: getattr(where(s), f), unit)
        elif isinstance(value, Teeth):
            angle = f"{name}.pressure_angle"
            yield Number(angle, lambda s, f=field.name: getattr(where(s), f).pressure_angle, "rad", 0.0)
        elif isinstance(value, Belt):
            for key, part in (("radii[0]", "radius"), ("radii[1]", "other"), ("tension", "tension")):
                yield Number(f"{name}.belt.{key}", lambda s, f=field.name, p=part: getattr(getattr(where(s), f), p),
                             UNITS[part], LEAST[part])  # fmt: skip
        elif isinstance(value, Guide | Drive):
            yield from _group(f"{name}.{field.name}", value, lambda s, f=field.name: getattr(where(s), f), slides)
        elif isinstance(value, tuple) and not field.metadata.get("static"):
            for i, each in enumerate(value):
                own = f"{name}.{field.name}[{i}]"
                yield from _group(own, each, lambda s, f=field.name, i=i: getattr(where(s), f)[i])
        elif eqx.is_array(value):
            unit = "rad" if field.name == "along" else UNITS.get(field.name, "rad")
            yield Number(f"{name}.{field.name}", lambda s, f=field.name: getattr(where(s), f), unit,
                         LEAST.get(field.name, -math.inf))  # fmt: skip


def _law(name: str, law: AbstractLaw, where: Where, unit: str) -> Iterator[Number]:
    """The numbers of a law of motion; those of a spline one by one."""
    for field in dataclasses.fields(law):
        value = getattr(law, field.name)
        if isinstance(value, tuple) and not field.metadata.get("static"):
            for i in range(len(value)):
                yield Number(f"{name}.{field.name}[{i}]", lambda s, f=field.name, i=i: getattr(where(s), f)[i], unit)
        elif eqx.is_array(value):
            yield Number(f"{name}.{field.name}", lambda s, f=field.name: getattr(where(s), f), unit)


def _load(name: str, load: AbstractLoad, where: Where) -> Iterator[Number]:
    for field in dataclasses.fields(load):
        value = getattr(load, field.name)
        if field.name == "window" and value is not None:
            yield Number(f"{name}.window.on", lambda s: where(s).window.on, "rad")
            yield Number(f"{name}.window.off", lambda s: where(s).window.off, "rad")
        elif isinstance(value, Vec):
            yield from _vec(f"{name}.{field.name}", lambda s, f=field.name: getattr(where(s), f), ("x", "y"), "N")
        elif eqx.is_array(value):
            size = field.name == "magnitude"
            key = ("force" if load.point else "torque") if size else field.name
            yield Number(f"{name}.{key}", lambda s, f=field.name: getattr(where(s), f),
                         "N" if load.point else "N m", 0.0 if size else -math.inf)  # fmt: skip
