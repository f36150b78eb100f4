"""Values of the families of measures: their names taken apart, and what each is made of."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Sequence

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._units import QuantityError, in_si, nearest
from linkjax.machine import Scene
from linkjax.measures._extremes import Extreme, Statistic, extremes_of, rows_of
from linkjax.measures._family import CONSTANT, FAMILIES, STATISTICS, Asked, Family
from linkjax.measures._forces import reaction_names
from linkjax.measures._inertia import RATIO, force_extremes, force_ratio
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES, net_turn
from linkjax.measures._strokes import between, path_lengths
from linkjax.mechanism import StructureError
from linkjax.motion import Grid, Place, Rows, Wanted, by_node, is_locked

SQUARE = "min_transmission_angle"
LONGER = 1e-12  # relative: a window of one cycle, up to rounding
WINDOW = re.compile(r"(.+?)\s+where\s+(.+?)\s+to\s+(.+)")


def taken_apart(text: str) -> Asked | None:
    """The parts of a name of a family; None for another name. Raises `StructureError` for a crank angle that cannot be
    read, or one that the family does not take."""
    text, window, angle = text.strip(), None, None
    if found := WINDOW.fullmatch(text):
        text, ends = found[1].strip(), found.groups()[1:]
        window = _crank_angle(ends[0], text), _crank_angle(ends[1], text)
    elif " where " in text:
        head, _, rest = text.partition(" where ")
        if head.partition(".")[0] not in FAMILIES:
            return None
        raise StructureError(head, f"{rest.strip()!r} is not a window", "write e.g. where 90deg to 180deg")
    head, at, place = text.partition("@")
    family, _, element = head.strip().partition(".")
    if family not in FAMILIES:
        return None
    if at:
        angle = _crank_angle(place, head)
    return Asked(family, element.strip(), angle, window)


def for_every_angle(asked: Asked, sense: str) -> Asked:
    """The extreme that a constraint for every crank angle limits; "at most" or "at least"."""
    family = FAMILIES[asked.family]
    if family.quantity is None or family.statistic or asked.angle is not None:
        return asked
    ways = ("max", "peak") if sense == "at most" else ("min",)
    way = next((way for way in ways if way in STATISTICS[family.quantity.name]), None)
    if way is None and family.name == "transmission_angle":
        better = asked._replace(family=SQUARE).text()
        remedy = f"limit {better} from below, for which an obtuse angle counts as its supplement"
        raise StructureError(asked.text(), "may be acute or obtuse", remedy)
    if way is None:
        raise StructureError(asked.text(), f"has no {ways[0]} that can be limited", "delete the constraint")
    return asked._replace(family=f"{way}_{family.name}")


def _crank_angle(text: str, name: str) -> float:
    text, remedy = text.strip(), "write it e.g. as 60deg"
    try:
        value, unit = in_si(text)
    except QuantityError as error:
        raise StructureError(name, f"{text!r} is not a crank angle: {error.problem}", remedy) from error
    if unit == "1":
        raise StructureError(name, f"{text!r} is a crank angle without a unit", f"write {text}deg")
    if unit != "rad" or not math.isfinite(value):
        raise StructureError(name, f"{text!r} is not a crank angle", remedy)
    return float(value)


def breaks_of(asked: Asked) -> tuple[float, ...]:
    """The crank angles (rad) at which panels must end for a measure: at the ends of its window, and at zero, where the
    angle of a link that turns fully begins anew."""
    quantity = FAMILIES[asked.family].quantity
    turning = asked.family == "swing" or (quantity is not None and quantity.name == "angle")
    return (*((0.0,) if turning else ()), *(asked.window or ()))


def checked(asked: Asked, scene: Scene) -> None:
    """Raise `StructureError` where a scene has no measure of this name."""
    family, name = FAMILIES[asked.family], asked.text()
    if lacking := family.lacking(scene):
        raise StructureError(name, *lacking)
    known = family.names(scene)
    if family.of and not (asked.element or family.name in ALL_OF):
        remedy = f"write e.g. {family.name}.{known[0]}" if known else "delete it"
        raise StructureError(name, f"names no {family.of}", remedy)
    if asked.element and not family.of:
        raise StructureError(name, "is of the whole machine, and takes no element", f"write {family.name}")
    if asked.element and asked.element not in known:
        what = {"stroke": "point of a slider", "travel": "point of a slider"}.get(family.name, f"moving {family.of}")
        what = {"group": "group with a transmission angle", "joint": "joint with a link"}.get(family.of, what)
        what = "slider or rocker" if family.name == "time_ratio" else what
        raise StructureError(name, f"{asked.element!r} is not a {what} of this machine", nearest(asked.element, known))
    if asked.angle is not None and family.at is None and (family.quantity is None or family.statistic):
        bare = "delete the crank angle"
        if family.quantity is not None and family.name.startswith(f"{family.statistic}_"):
            plain = asked._replace(family=family.name.removeprefix(f"{family.statistic}_"))
            bare = f"write {plain.text()}, or {bare}"
        raise StructureError(name, "is one value of the whole cycle, not one at a crank angle", bare)
    if asked.window is not None:
        check_window(asked, scene)
    if asked.angle is None and family.quantity is not None and not family.statistic:
        ways = [f"{each}_{asked.text()}" for each in STATISTICS[family.quantity.name]]
        remedy = f"write {', '.join([*ways, f'{asked.text()}@60deg'])}, or a constraint for every crank angle"
        raise StructureError(name, "has a value at every crank angle", remedy)


def check_window(asked: Asked, scene: Scene) -> None:
    """Raise `StructureError` for a window of what is no extreme, and for one that is longer than a cycle."""
    family, name = FAMILIES[asked.family], asked.text()
    assert asked.window is not None
    on, off = asked.window
    if family.name != SQUARE and (family.quantity is None or family.statistic not in ("peak", "max", "min")):
        raise StructureError(name, "is not an extreme, and has no window", f"write {family.name}")
    if off - on > scene.cycle * (1 + LONGER):
        wide, cycle = (f"{math.degrees(angle):.6g}" for angle in (off - on, scene.cycle))
        problem = f"its window of {wide} degrees is longer than the cycle of {cycle} degrees"
        raise StructureError(name, problem, "shorten it, or set cycle_turns if the cycle has several turns")


ALL_OF = ("peak_reaction", f"peak_reaction{CONSTANT}")  # families that without an element are of all of them


def extreme(asked: Asked, scene: Scene) -> Extreme | None:
    """What is looked for, if the measure is an extreme of a quantity."""
    family = FAMILIES[asked.family]
    if family.quantity is None or family.statistic not in ("peak", "max", "min"):
        return None
    ways: dict[str, Statistic] = {"peak": "peak", "max": "max", "min": "min"}
    every = tuple(f"{joint}.{link}" for joint, link in reaction_names(scene)) if family.of else ()
    elements = (asked.element,) if asked.element else every
    return Extreme(family.quantity, elements, ways[family.statistic], not family.motion, asked.window)


def values_of(of: Parts, asked: Sequence[Asked]) -> list[Array]:
    """The values of measures; all extremes among them are found together."""
    means = _every_mean(of, asked)
    paths = list(dict.fromkeys(each for each in asked if each.family == "path_length"))
    if paths:
        means |= dict(zip(paths, path_lengths(of, tuple(each.element for each in paths)), strict=True))
    plans = [_plan(of, each) for each in asked if each not in means]
    found = iter(extremes_of(of, [one for extremes, _ in plans for one in extremes]))
    others = iter([finish(*(next(found) for _ in extremes)) for extremes, finish in plans])
    values = [means[each] if each in means else next(others) for each in asked]
    return [_unless_locked(of, each, value) for each, value in zip(asked, values, strict=True)]


def _unless_locked(of: Parts, asked: Asked, value: Array) -> Array:
    """The value of a measure of forces, infinite where friction locks the machine: then there are none."""
    family = FAMILIES[asked.family]
    forced = family.name == RATIO or (family.quantity is not None and family.quantity.forced)
    if not (forced and of.scene.friction) or asked.angle is not None:
        return value
    regime = of.with_kinks(of.true_motion if family.motion else of.constant_speed)
    moves = regime.forces(of.nodes_in(regime)).moves
    return of.machine.run(_limited, regime.grid, moves, value, least=family.statistic == "min")


@compiled_soon(static=("least",))
def _limited(grid: Grid, moves: Array, value: Array, least: bool) -> Array:
    return jnp.where(is_locked(grid, moves), -jnp.inf if least else jnp.inf, value)


def _every_mean(of: Parts, asked: Sequence[Asked]) -> dict[Asked, Array]:
    """The values of those that are a mean, or a root mean square, over time, found together for each quantity."""
    found: dict[Asked, Array] = {}
    which = dict.fromkeys(each.family for each in asked if FAMILIES[each.family].statistic in ("rms", "mean"))
    for name in which:
        family, own = FAMILIES[name], list(dict.fromkeys(each for each in asked if each.family == name))
        assert family.quantity is not None
        regime = family.quantity.regime(of, family.motion)
        at = of.nodes_in(regime)
        vectors = family.quantity.at(of, tuple(each.element for each in own if each.element))(regime, at)
        nodes = of.machine.run(by_node, regime.grid, vectors)
        mean = _rms if family.statistic == "rms" else _mean
        found |= dict(zip(own, of.machine.run(mean, regime.grid, nodes, regime.crank(at)[0]), strict=True))
    return found


def _plan(of: Parts, asked: Asked) -> tuple[list[Extreme], Callable[..., Array]]:
    """The extremes that a measure is made of, and how."""
    family = FAMILIES[asked.family]
    if family.name == "stroke":
        return between("travel", asked.element), lambda high, low: high - low
    if family.name == SQUARE:
        return [off_square(asked)], lambda most: 0.5 * math.pi - most
    if family.name == RATIO:
        return force_extremes(of), lambda *both: of.machine.run(force_ratio, *both)
    if family.name == "swing":
        net = jnp.abs(net_turn(of, asked.element))
        return between("angle", asked.element), lambda high, low: jnp.where(net > 0, net, high - low)
    value, at, quantity, angle = family.value, family.at, family.quantity, asked.angle
    if at is not None and angle is not None:
        return [], lambda: at(of, angle)
    if value is not None:
        return [], lambda: value(of, asked.element)
    assert quantity is not None
    if angle is not None:
        return [], lambda: at_angle(of, family, asked.element, angle)
    found = extreme(asked, of.scene)
    assert found is not None
    if family.statistic == "peak" and found.window is None and len(found.elements) < 2 and found.numbers(of.scene):
        sides: tuple[Statistic, ...] = ("max", "min")  # better than two summits of the magnitude
        return [found._replace(statistic=way) for way in sides], lambda high, low: jnp.maximum(high, -low)
    return [found], (
        lambda most: safe_divide(jnp.ones_like(most), most, jnp.inf)
    ) if family.inverse else lambda most: most


def has_rows(asked: Asked) -> bool:
    """Whether a measure is an extreme."""
    family = FAMILIES[asked.family]
    return family.rows is not None or (family.quantity is not None and family.statistic in ("peak", "max", "min"))


def rows(of: Parts, asked: Asked) -> Rows | Wanted:
    """All values that may be the measure, an extreme."""
    family = FAMILIES[asked.family]
    if family.name == SQUARE and asked.window is not None:
        wanted = rows_of(of, off_square(asked))
        beyond = wanted.finish
        assert beyond is not None
        return wanted._replace(finish=lambda tops: of.machine.run(_off_zero, beyond(tops)))
    if family.rows is not None:
        return family.rows(of, asked.element)
    found = extreme(asked, of.scene)
    assert found is not None
    wanted = rows_of(of, found)
    if not family.inverse:
        return wanted
    finish = wanted.finish
    assert finish is not None
    return wanted._replace(finish=lambda tops: of.machine.run(_inverse, finish(tops)))


def off_square(asked: Asked) -> Extreme:
    """How far the transmission angle of a group is from a right angle at most."""
    return Extreme(QUANTITIES["off_square"], (asked.element,), "peak", True, asked.window)


@compiled_soon
def _off_zero(rows: Rows) -> Rows:
    """Acute and supplement of obtuse angles, from what is beyond a right angle: no kink between them."""
    beyond = rows.vectors[:, :1]
    both = jnp.concatenate([0.5 * jnp.pi - beyond, 0.5 * jnp.pi + beyond])
    return Rows(both, jnp.concatenate([rows.angle, rows.angle]), signed=True)


@compiled_soon
def _inverse(rows: Rows) -> Rows:
    """One over numbers that are not negative; infinite where they are zero."""
    return dataclasses.replace(rows, vectors=safe_divide(jnp.ones_like(rows.vectors), rows.vectors, jnp.inf))


def at_angle(of: Parts, family: Family, element: str, angle: float) -> Array:
    """A quantity at a crank angle (rad): the number, or the length of the vector."""
    assert family.quantity is not None
    elements = (element,) if element else ()
    regime = of.true_motion if family.motion else of.constant_speed
    place = of.machine.run(_place, of.grid, jnp.asarray(angle))
    at = regime.at(place)
    found = family.quantity.at(of, elements)(regime, at)
    moves = regime.forces(at).moves if family.quantity.forced and of.scene.friction else None
    return of.machine.run(_first, found, moves, signed=family.quantity.signed(of.scene, element))


@compiled_soon
def _place(grid: Grid, angle: Array) -> Place:
    one = grid.place(angle)
    return Place(*(part[None] for part in one))


@compiled_soon(static=("signed",))
def _first(found: Array, moves: Array | None, signed: bool) -> Array:
    vector = found[0, :, 0]
    value = vector[0] if signed else safe_sqrt(vector @ vector)
    return value if moves is None else jnp.where(moves[0], value, jnp.inf)


@compiled_soon
def _rms(grid: Grid, nodes: Array, speed: Array) -> list[Array]:
    """Root mean squares over time, from vectors at the nodes, shape (quantities, 2, panels, n)."""
    weights = _in_time(grid, speed)
    return list(safe_sqrt(jnp.sum(weights[None] * jnp.sum(nodes**2, axis=1), axis=(1, 2)) / jnp.sum(weights)))


@compiled_soon
def _mean(grid: Grid, nodes: Array, speed: Array) -> list[Array]:
    """Means over time of numbers, from vectors at the nodes, shape (quantities, 2, panels, n)."""
    weights = _in_time(grid, speed)
    return list(jnp.sum(weights[None] * nodes[:, 0], axis=(1, 2)) / jnp.sum(weights))


def _in_time(grid: Grid, speed: Array) -> Array:
    """Weights of the nodes in an integral over time (s), with the crank speed (rad/s) at them, which come first."""
    return grid.half[:, None] * grid.rule.w[None] / speed[: grid.size].reshape(grid.nodes.shape)
