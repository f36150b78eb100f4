"""The scene parameters by name, as an optimiser changes them: `links.rod.length`, `fixed.F.x`, `flywheel.inertia`.

Names follow the keys of scene files. A position on a link has `along` and `across`, a point of the frame `x` and `y`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._renamed import renamed
from linkjax._units import DIMENSIONS, QuantityError, in_si, quantity
from linkjax._vec import Vec
from linkjax.design._load_names import table_parameters
from linkjax.drives import drive_numbers
from linkjax.friction import Thrust
from linkjax.groups import AbstractGroup, AbstractLaw, Belt, Drive, Guide, Moves, Slot, Teeth
from linkjax.loads import AbstractLoad, Passage
from linkjax.machine import Scene
from linkjax.mechanism import Link

Where = Callable[[Scene], Any]

UNITS = {
    "length": "m", "mass": "kg", "inertia": "kg m^2", "along": "m", "across": "m", "x": "m", "y": "m", "area": "m^2",
    "density": "kg/m^3", "thickness": "m", "offset": "m", "speed": "rad/s", "angle": "rad", "torque": "N m",
    "force": "N", "radius": "m", "other": "m", "start": "m", "tension": "N", "phase": "rad", "slot": "rad",
    "pressure_angle": "rad",
}  # fmt: skip
DIMENSION_OF = {dimension.unit or "1": name for name, dimension in DIMENSIONS.items()}
COUNTERWEIGHT = re.compile(r"links\.(.+)\.counterweights\.([^.]+)(?:\..*)?")
NAMELESS = re.compile(r"links\.(.+)\.counterweight\.(mass|at\.along|at\.across|inertia|thickness|density)")
SUGGESTED = 5  # near names in a message
LEAST = {
    "inertia": 0.0,
    "thickness": 1e-6,
    "density": 1.0,
    "radius": 1e-6,
    "other": 1e-6,
    "tension": 0.0,
    "pressure_angle": 0.0,
}  # discs have a radius
OF_LOADS = {  # units of the numbers of loads: at a point, and on a link without one
    "stiffness": ("N/m", "N m/rad"), "coefficient": ("N s/m", "N m s/rad"), "linear": ("N s/m", "N m s/rad"),
    "quadratic": ("N s^2/m^2", "N m s^2/rad^2"), "free_length": ("m", "m"), "free_angle": ("rad", "rad"),
}  # fmt: skip
POSITIVE = ("magnitude", "stiffness", "coefficient", "linear", "quadratic", "free_length")  # of loads: zero or more


@dataclasses.dataclass(frozen=True)
class Number:
    """One scene parameter: where it is in the tree, its unit, and its smallest allowed value."""

    name: str
    where: Where
    unit: str
    least: float = -math.inf

    def read(self, scene: Scene) -> Array:
        """Its value in a scene (SI)."""
        return self.where(scene)


class DesignError(ValueError):
    """A wrong optimisation problem. The message names the element, what is wrong with it, and the remedy."""

    def __init__(self, element: str, problem: str, remedy: str):
        self.element, self.problem, self.remedy = element, problem, remedy
        super().__init__(f"{element}: {problem}; {remedy}")


def numbers(scene: Scene) -> dict[str, Number]:
    """Every scene parameter that an optimiser can change, by name."""
    return {number.name: number for number in _numbers(scene)}


def number(scene: Scene, name: str) -> Number:
    """The scene parameter of this name. Raises `DesignError` with the nearest known names."""
    known = numbers(scene)
    if name not in known:
        _check_counterweight(scene, name)
        inner = [other for other in known if other.startswith(f"{name}.")]
        hint = f"it has: {', '.join(inner)}" if inner else _counterweight(scene, name) or near(name, known)
        raise DesignError(name, "is not a scene parameter", hint or "linkjax.design.numbers(scene) holds all names")
    return known[name]


def _counterweight(scene: Scene, name: str) -> str:
    """The hint for a parameter of a counterweight without the name of the counterweight; an empty string if it is not
    one."""
    found = NAMELESS.fullmatch(name)
    link = found and scene.mechanism.links.get(found[1])
    if not found or link is None:
        return ""
    keys = [f"links.{found[1]}.counterweights.{each}.{found[2]}" for each in link.counterweights or ("NAME",)]
    return f"did you mean {' or '.join(map(repr, keys[:SUGGESTED]))}?"


def _check_counterweight(scene: Scene, name: str) -> None:
    """Raise `DesignError` for a parameter of a counterweight that the link does not have."""
    found = COUNTERWEIGHT.fullmatch(name)
    link = found and scene.mechanism.links.get(found[1])
    if not found or link is None or found[2] in link.counterweights:
        return
    piece = found[2]
    others = f" (it has {', '.join(map(repr, link.counterweights))})" if link.counterweights else ""
    key = f"links.{found[1]}.counterweights.{piece}"
    raise DesignError(
        name, f"link {found[1]!r} has no counterweight {piece!r}{others}",
        f"add it: --set '{key}={{mass = 0, at = \"-100 mm\"}}', a table [{key}] in the scene file, "
        f'or in Python Link(..., counterweights={{"{piece}": Counterweight(0.0, Vec(-0.1, 0.0))}})',
    )  # fmt: skip


def near(name: str, known: Iterable[str]) -> str:
    """A question with the known names that are similar to a name or contain it; an empty string if there are none."""
    names = list(known)
    if new := renamed(name, names):
        return f"it is called {new!r} now"
    close = difflib.get_close_matches(name, names, n=SUGGESTED)
    close += [other for other in names if len(name) > 2 and name.lower() in other.lower()]
    found = [repr(each) for each in dict.fromkeys(close)][:SUGGESTED]
    return f"did you mean {' or '.join(part for part in (', '.join(found[:-1]), found[-1]) if part)}?" if found else ""


def amount(value: Any, unit: str, element: str) -> float:
    """The value in SI of a number (SI) or of a string with a unit. Raises `DesignError` naming the element."""
    if isinstance(value, str):
        if unit not in DIMENSION_OF:
            return _in_unit(value, unit, element)
        try:
            return quantity(value, DIMENSION_OF[unit])
        except QuantityError as error:
            raise DesignError(element, f"{value!r}: {error.problem}", error.remedy) from error
    remedy = f"write a number in {unit}, or a string with a unit"
    try:
        found = float(value)
    except (TypeError, ValueError) as error:
        raise DesignError(element, f"{value!r} is not a number", remedy) from error
    if not math.isfinite(found):
        raise DesignError(element, f"{value!r} is not a finite number", remedy)
    return found


def _in_unit(text: str, unit: str, element: str) -> float:
    """The number in a string whose unit is not one of `DIMENSIONS`: of a known derived unit, or written exactly so."""
    with contextlib.suppress(QuantityError):
        found, own = in_si(text)
        if own == unit:
            return found
    try:
        return float(re.sub(rf"\s*{re.escape(unit)}\s*$", "", text))
    except ValueError as error:
        raise DesignError(element, f"{text!r} is not a number in {unit}", f"write a number in {unit}") from error


def changed(scene: Scene, values: Mapping[str, Any] | Sequence[tuple[Number, Any]]) -> Scene:
    """The scene with some parameters replaced, by name or by `Number`. A value is a number or traced array (SI), or a
    string with a unit ("150 mm"). Differentiable with respect to the values."""
    pairs = [(number(scene, k), v) for k, v in values.items()] if isinstance(values, Mapping) else list(values)
    if not pairs:
        return scene
    given = [amount(value, at.unit, at.name) if isinstance(value, str) else value for at, value in pairs]
    new = [jnp.asarray(value, dtype=at.read(scene).dtype) for (at, _), value in zip(pairs, given, strict=True)]
    return eqx.tree_at(lambda tree: [at.where(tree) for at, _ in pairs], scene, new)


def in_si_of(scene: Scene, name: str, value: Any) -> float:
    """The value in SI of a scene parameter, given in SI or as a string with a unit."""
    return amount(value, number(scene, name).unit, name)


def _numbers(scene: Scene) -> Iterator[Number]:
    bars = {link for group in scene.mechanism.groups for link, (_, far) in group.pins().items() if far is not None}
    for point in scene.mechanism.fixed:
        yield from _vec(f"fixed.{point}", lambda s, p=point: s.mechanism.fixed[p], ("x", "y"))
    for name, link in scene.mechanism.links.items():
        yield from _link(f"links.{name}", link, lambda s, n=name: s.mechanism.links[n], name in bars)
    yield Number("flywheel.inertia", lambda s: s.mechanism.flywheel.inertia, "kg m^2", 0.0)
    for i, group in enumerate(scene.mechanism.groups):
        yield from _group(f"groups.{'-'.join(group.link_names())}", group, lambda s, i=i: s.mechanism.groups[i],
                          group.drive_slides())  # fmt: skip
    for i, load in enumerate(scene.loads):
        yield from _load(f"loads.{load.name}", load, lambda s, i=i: s.loads[i])
    for i, friction in enumerate(scene.friction):
        yield from _rubbing(f"joints.{friction.joint}", friction, lambda s, i=i: s.friction[i])
    for each in () if scene.motor is None else drive_numbers(scene.motor):
        yield Number(f"motor.{each.key}", lambda s, where=each.where: where(s.motor), each.unit,
                     -math.inf if each.signed else 0.0)  # fmt: skip
    yield Number("speed", lambda s: s.speed, "rad/s", 0.0)
    yield from _vec("gravity", lambda s: s.gravity, ("x", "y"), "m/s^2")


def _vec(name: str, where: Where, parts: tuple[str, str] = ("along", "across"), unit: str = "m") -> Iterator[Number]:
    yield Number(f"{name}.{parts[0]}", lambda s: where(s).x, unit)
    yield Number(f"{name}.{parts[1]}", lambda s: where(s).y, unit)


def _link(name: str, link: Link, where: Where, bar: bool) -> Iterator[Number]:
    given = ("area", "density") if link.mass_properties == "section" else ("mass", "inertia")
    given = given if link.uniform is False else ("mass",)
    for key in (*(("length",) if bar else ()), *given):
        yield Number(f"{name}.{key}", lambda s, k=key: getattr(where(s), k), UNITS[key], 0.0)
    if link.mass_properties != "section" and link.uniform is False:
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


OF_FRICTION = {  # units and smallest values of the numbers of friction
    "coefficient": ("1", 0.0), "static": ("1", 0.0), "radius": ("m", 0.0), "groove": ("rad", 1e-3),
    "length": ("m", 1e-6), "seat": ("1", 1.0), "force": ("N", 0.0), "outer": ("m", 1e-6), "inner": ("m", 0.0),
    "efficiency": ("1", 1e-3),
}  # fmt: skip


def _rubbing(name: str, friction: Any, where: Where) -> Iterator[Number]:
    """The parameters of the friction of a joint, and of its thrust face."""
    for field in dataclasses.fields(friction):
        key, value = field.name, getattr(friction, field.name)
        if isinstance(value, Thrust):
            yield from _rubbing(f"{name}.{key}", value, lambda s: where(s).thrust)
        elif value is not None and key in OF_FRICTION:
            unit, least = OF_FRICTION[key]
            yield Number(f"{name}.{key}", lambda s, k=key: getattr(where(s), k), unit, least)


def _group(
    name: str, group: AbstractGroup | Guide | Drive | Slot, where: Where, slides: bool = False
) -> Iterator[Number]:
    """The parameters of a group, of its guides and of its drive, by the keys of a scene file; `slides` says whether the
    drive is linear."""
    for field in dataclasses.fields(group):
        value = getattr(group, field.name)
        if (
            field.name == "path"
            or (isinstance(value, Guide) and ".gears[" in name)
            or (field.name == "phase" and slides)
        ):
            continue  # not a parameter of the design, without effect, or the guide of a rack, which is that of a slot
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
    """The parameters of a motion law; each value of a spline is one."""
    for field in dataclasses.fields(law):
        value = getattr(law, field.name)
        if isinstance(law, Moves) and field.name == "moves":
            yield from _moves(f"{name}.moves", law, lambda s: where(s).moves, unit)
        elif isinstance(value, tuple) and not field.metadata.get("static"):
            for i in range(len(value)):
                yield Number(f"{name}.{field.name}[{i}]", lambda s, f=field.name, i=i: getattr(where(s), f)[i], unit)
        elif eqx.is_array(value):
            yield Number(f"{name}.{field.name}", lambda s, f=field.name: getattr(where(s), f), unit)


def _moves(name: str, law: Moves, where: Where, unit: str) -> Iterator[Number]:
    """The values, crank angles and ramps of the moves of a law."""
    units = {"to": unit, "over": "rad", "ramp": "1"}
    for i, move in enumerate(law.moves):
        for key in units:
            if getattr(move, key) is not None:
                yield Number(f"{name}[{i}].{key}", lambda s, i=i, k=key: getattr(where(s)[i], k), units[key],
                             -math.inf if key == "to" else 0.0)  # fmt: skip


def _load(name: str, load: AbstractLoad, where: Where) -> Iterator[Number]:
    tabulated = table_parameters(load)
    for key, of, unit, least in tabulated or ():
        yield Number(f"{name}.{key}", lambda s, of=of: of(where(s)), unit, least)
    for field in dataclasses.fields(load):
        value = getattr(load, field.name)
        if tabulated is not None and field.name != "window":
            continue
        if isinstance(value, Passage):
            yield from _passage(f"{name}.window", value, lambda s: where(s).window)
        elif field.name == "window" and value is not None:
            yield Number(f"{name}.window.on", lambda s: where(s).window.on, "rad")
            yield Number(f"{name}.window.off", lambda s: where(s).window.off, "rad")
        elif isinstance(value, Vec):
            yield from _vec(f"{name}.{field.name}", lambda s, f=field.name: getattr(where(s), f), ("x", "y"), "N")
        elif eqx.is_array(value):
            key = ("force" if load.point else "torque") if field.name == "magnitude" else field.name
            unit = OF_LOADS.get(field.name, ("N", "N m"))[0 if load.point else 1]
            yield Number(f"{name}.{key}", lambda s, f=field.name: getattr(where(s), f), unit,
                         0.0 if field.name in POSITIVE else -math.inf)  # fmt: skip


def _passage(name: str, window: Passage, where: Where) -> Iterator[Number]:
    """The lengths or angles of a window that is given by what happens."""
    for key in ("first", "last"):
        if getattr(window, key) is not None:
            yield Number(f"{name}.{key}", lambda s, key=key: getattr(where(s), key), window.unit, 0.0)
    for i in range(0 if window.between is None else 2):
        yield Number(f"{name}.between[{i}]", lambda s, i=i: where(s).between[i], window.unit)
    if window.direction is not None:
        yield Number(f"{name}.direction", lambda s: where(s).direction, "rad")
