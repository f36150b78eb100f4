"""Results over the whole cycle, refined between scan points: dead centres, strokes and least margins."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._batches import Batches
from linkjax._compile import compiled_soon
from linkjax._numerics import largest, nearest_turn, safe_sqrt, smallest, wrapped
from linkjax._search import (
    MARGIN_SCAN,
    MOTION_SCAN,
    Found,
    Motion,
    Reversals,
    Values,
    own,
    refined,
    scan_angles,
    scan_least,
    scan_reversals,
    stacked_motions,
    towards_least,
)
from linkjax._vec import Vec
from linkjax.groups import BEYOND, AbstractLaw, Margin, ReferencePath
from linkjax.kinematics._pose import (
    Pose,
    Prepared,
    check_cycle,
    margins,
    margins_of_pose,
    named_groups,
    plain,
    pose,
    prepared,
)
from linkjax.mechanism import Mechanism

DEAD_CENTRES = 8  # slots per link and crank turn
POLISH = 3  # Newton steps for a dead centre
SHARPEN = 4  # Newton steps from the best scan point to a least margin


class Positions(NamedTuple):
    """Pose and margins at many places, leaves of shape (places,)."""

    pose: Pose
    margins: dict[str, dict[str, Margin]]


@compiled_soon
def _positions(ready: Prepared, phi: Array) -> Positions:
    def at(phi):
        here = pose(ready, phi)
        return Positions(here, margins_of_pose(ready, here, phi))

    return jax.vmap(at)(phi)


class Positioned(Batches):
    """A prepared mechanism evaluated at many crank angles at once."""

    def sample(self, phi: Any, *, fixed: bool = False, **_: Any) -> Positions:
        """Pose and margins at the crank angles `phi` (rad)."""
        return self.ask(_positions, phi, fixed=fixed)

    @property
    def prepared(self) -> Prepared:
        """The mechanism with its paths."""
        return self.design

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism."""
        return self.design.mechanism


def dead_centres(mechanism: Mechanism | Prepared, cycle_turns: int = 1) -> dict[str, Reversals]:
    """Dead centres of sliders and limit positions of rockers, over `cycle_turns` turns of the crank.

    Returns {name: `Reversals`} for the pin of every slider on a guide of the frame and for every link pivoted on the
    frame, except a crank that drives without a motion law. Crank angles are in rad, accurate to rounding, in
    8 `cycle_turns` slots each and one for each stop of a motion law; `Reversals.true` selects the used ones. Where a
    law rests before it turns back, the angle is that at which it stops. If the mechanism cannot be assembled over the
    whole cycle, the values are finite but meaningless. Differentiable with respect to the design. Raises `ValueError`
    for a number of turns below one.
    """
    check_cycle(cycle_turns)
    return find_dead_centres(Positioned(prepared(mechanism, cycle_turns)), cycle_turns)


def find_dead_centres(machine: Any, cycle_turns: int, scanned: Any = None) -> dict[str, Reversals]:
    """The same, asked of a machine in batches; `scanned` is the pose at `MOTION_SCAN` angles per turn, if known."""
    ends = stopping_ends(machine.mechanism)
    if not ends:
        return {}
    slots = DEAD_CENTRES * cycle_turns
    scanned = (
        machine.sample(scan_angles(cycle_turns, MOTION_SCAN), fixed=True, dynamics=False).pose
        if scanned is None
        else scanned
    )
    found, flat = machine.run(_scanned_ends, _motions(ends, scanned), turns=cycle_turns, slots=slots)

    def step(state):
        angle, flat = state
        return machine.run(
            _next_ends, angle, _motions(ends, machine.sample(flat, fixed=True, dynamics=False).pose), found
        )

    angle, flat = machine.loop(POLISH - 1, step, (found.angle, flat))
    every = machine.run(_refined_ends, angle, _motions(ends, machine.sample(flat, dynamics=False).pose), found)
    law = plain(machine.prepared).driver.follows()
    if law is not None and law.stops() is not None:
        beside = machine.run(_beside_stops, law, turns=cycle_turns)
        moving = _motions(ends, machine.sample(beside, fixed=True, dynamics=False).pose)
        every = machine.run(_with_stops, every, law, moving, turns=cycle_turns)
    return dict(zip(ends, every, strict=True))


@compiled_soon(static=("turns", "slots"))
def _scanned_ends(motions: tuple[Motion, ...], turns: int, slots: int) -> tuple[Found, Array]:
    scan = scan_angles(turns, MOTION_SCAN)
    v, a = (part[..., : scan.size] for part in stacked_motions(motions))
    found = scan_reversals(v, a, scan, slots)
    return found, found.angle.ravel()


def _refine(angle: Array, motions: tuple[Motion, ...], found: Found) -> Reversals:
    v, a = (own(part, angle.shape[1]) for part in stacked_motions(motions))
    return refined(angle, v, a, 2 * math.pi / MOTION_SCAN, found)


@compiled_soon
def _next_ends(angle: Array, motions: tuple[Motion, ...], found: Found) -> tuple[Array, Array]:
    angle = _refine(angle, motions, found).angle
    return angle, angle.ravel()


@compiled_soon
def _refined_ends(angle: Array, motions: tuple[Motion, ...], found: Found) -> list[Reversals]:
    every = _refine(angle, motions, found)
    return [Reversals(*(leaf[i] for leaf in every)) for i in range(angle.shape[0])]


@compiled_soon(static=("turns",))
def _beside_stops(law: AbstractLaw, turns: int) -> Array:
    """Crank angles (rad) before all stops of a motion law, and after them."""
    stops = law.every_stop(2 * math.pi * turns)
    assert stops is not None
    near = jnp.minimum(stops.near, 2 * math.pi / MOTION_SCAN)
    return jax.lax.stop_gradient(jnp.concatenate([stops.begin - near, stops.end + near]))


@compiled_soon(static=("turns",))
def _with_stops(found: list[Reversals], law: AbstractLaw, beside: tuple[Motion, ...], turns: int) -> list[Reversals]:
    """Where a motion law stops, a slider or link is at a dead centre if it moves back afterwards, and there is no other
    one. The steps of the search would not end there, because the acceleration vanishes, too."""
    cycle, step = 2 * math.pi * turns, 2 * math.pi / MOTION_SCAN
    stops = law.every_stop(cycle)
    assert stops is not None
    count, none = stops.begin.size, jnp.zeros_like(stops.begin)
    near = jnp.minimum(stops.near, step)
    velocity, every = stacked_motions(beside)[0], []
    for i, each in enumerate(found):
        late = wrapped(each.angle[:, None] - stops.begin[None] + near[None], cycle)
        stands = jnp.any(late < (stops.end - stops.begin + 2 * near)[None], axis=1)
        before, after = velocity[i, :, :count], velocity[i, :, count : 2 * count]
        rests = jnp.all(after == 0, axis=0)  # in a move to the same value
        after = jnp.where(rests[None], jnp.roll(after, -1, axis=1), after)
        back = jnp.sum(before * after, axis=0) < 0
        more = Reversals(stops.begin, none, back, none, none + 1, each.overflow)
        there = each._replace(present=each.present & ~stands)
        parts = [jnp.concatenate(pair) for pair in zip(there[:-1], more[:-1], strict=True)]
        angle, distance, present, left, rate = parts
        every.append(Reversals(angle, distance, present, left, rate, each.overflow))
    return every


def strokes(mechanism: Mechanism | Prepared, found: dict[str, Reversals], cycle_turns: int = 1) -> dict[str, Array]:
    """Strokes of sliders (m) and swing angles of rockers (rad), by the names of `dead_centres`.

    `found` is the result of `dead_centres` for the same `mechanism` and `cycle_turns`. The stroke of a slider is the
    distance between its outermost dead centres. A link or slider that never reverses has zero; a link that reverses
    but also makes full rotations has NaN.
    """
    return find_strokes(Positioned(prepared(mechanism, cycle_turns)), found, cycle_turns)


def find_strokes(machine: Any, found: dict[str, Reversals], cycle_turns: int, scanned: Any = None) -> dict[str, Any]:
    """The same, asked of a machine in batches; `scanned` is the pose at `MOTION_SCAN` angles per turn, if known."""
    if not found:
        return {}
    ends = stopping_ends(machine.mechanism)
    scanned = machine.sample(scan_angles(cycle_turns, MOTION_SCAN), dynamics=False).pose if scanned is None else scanned
    given = tuple(found[name] for name in ends)
    there = machine.sample(machine.run(_places_of, given), dynamics=False).pose
    slides = tuple(ends.values())
    every = machine.run(_strokes, given, _at(ends, scanned), _at(ends, there), turns=cycle_turns, slides=slides)
    return dict(zip(ends, every, strict=True))


@compiled_soon
def _places_of(found: tuple[Reversals, ...]) -> Array:
    return jnp.concatenate([each.angle for each in found])


@compiled_soon(static=("turns", "slides"))
def _strokes(
    found: tuple[Reversals, ...], scanned: list[Vec], there: list[Vec], turns: int, slides: tuple[bool, ...]
) -> list[Array]:
    scan, slots, covered = scan_angles(turns, MOTION_SCAN), found[0].angle.size, []
    for i, (each, whole, at) in enumerate(zip(found, scanned, there, strict=True)):
        true, x, y = each.true, *(part[i * slots : (i + 1) * slots] for part in (at.x, at.y))
        both = true[:, None] & true[None, :]
        if slides[i]:
            reach = safe_sqrt((x[:, None] - x[None]) ** 2 + (y[:, None] - y[None]) ** 2)
        else:
            coarse = jnp.unwrap(jnp.arctan2(whole.y[: scan.size], whole.x[: scan.size]))
            near = coarse[jnp.round(each.angle / scan[1]).astype(int) % scan.size]
            turned = near + nearest_turn(jnp.arctan2(y, x) - near, 2 * math.pi)
            rest = nearest_turn(coarse[0] - coarse[-1], 2 * math.pi)
            net = jnp.abs(coarse[-1] + rest - coarse[0])  # a link that rotates fully has no swing
            reach = jnp.where(net < math.pi, turned[:, None] - turned[None, :], jnp.nan)
        covered.append(largest(jnp.where(both, reach, 0.0)))
    return covered


def _at(ends: dict[str, bool], here: Pose) -> list[Vec]:
    """Position (m) of every pin and direction of every link in `ends`."""
    return [here.points[name].r if slides else here.links[name].u for name, slides in ends.items()]


def stopping_ends(mechanism: Mechanism) -> dict[str, bool]:
    """Pins of sliders (True) and links pivoted on the frame (False), without a driving crank that has no motion law."""
    ends, turning = {}, mechanism.driver.shaft() is not None and not mechanism.prescribed
    for group in mechanism.groups[turning:]:
        ends |= {joint.point: True for joint in group.joints() if joint.slides and joint.by == "frame"}
        for link, pins in group.pins().items():
            pins = (*pins, *mechanism.links[link].pins)
            if any(pin in mechanism.fixed for pin in pins) and link not in group.translating():
                ends[link] = False
    return ends


def _motions(ends: dict[str, bool], here: Pose) -> tuple[Motion, ...]:
    """Motion of every pin and link in `ends`."""
    found = []
    for name, slides in ends.items():
        if slides:
            p = here.points[name]
            found.append(Motion((p.dr.x, p.dr.y), (p.ddr.x, p.ddr.y)))
        else:
            found.append(Motion((here.links[name].w,), (here.links[name].e,)))
    return tuple(found)


class Least(NamedTuple):
    """Least value of a margin over the continuous cycle, and the crank angle (rad) where it occurs."""

    value: Array
    angle: Array


def assembly_margins(mechanism: Mechanism | Prepared, cycle_turns: int = 1) -> dict[str, dict[str, Least]]:
    """Least signed margin of every group to each of its singular positions over the continuous cycle.

    Returns {group: {side: `Least`}}. Margins are dimensionless; a negative one is the shortfall of a group that cannot
    be assembled. Values and gradients are always finite, and the gradient points towards designs that can be assembled.
    """
    return find_margins(Positioned(prepared(mechanism, cycle_turns)), cycle_turns)


def find_margins(
    machine: Any, cycle_turns: int, scanned: Any = None, points: int = MARGIN_SCAN
) -> dict[str, dict[str, Least]]:
    """The same, asked of a machine in batches; `scanned` are the margins at `points` angles per turn, a multiple of
    `MARGIN_SCAN`, if known."""
    groups = machine.prepared.along()
    names = [(name, side) for name, along in groups.items() for side in along.group.singular_positions()]
    if not names:
        return {}

    def asked(phi, fixed=True):
        return _listed(names, machine.sample(phi, fixed=fixed, dynamics=False, gaps=True).margins)

    scanned = asked(scan_angles(cycle_turns, MARGIN_SCAN)) if scanned is None else _listed(names, scanned)
    loops = tuple(side == "loops" for _, side in names)  # singular values, which have no sign
    paths = [groups[group].path if loop else None for (group, _), loop in zip(names, loops, strict=True)]
    paths = [jax.lax.stop_gradient(path) if isinstance(path, ReferencePath) else None for path in paths]
    given, how = (scanned, paths), {"turns": cycle_turns, "every": points // MARGIN_SCAN}
    start = machine.run(_scanned_margins, *given, **how)

    def step(phi):
        return machine.run(_next_margins, phi, start, asked(phi), loops=loops)

    phi = machine.loop(SHARPEN, step, start)
    law = plain(machine.prepared).driver.follows()
    if law is not None and law.breaks():
        phi = machine.run(_with_lowest, phi, scanned, **how)
    back = [None if side == "apart" else groups[group].returns() for group, side in names]
    every = machine.run(_least_margins, phi, asked(phi, fixed=False), back, turns=cycle_turns)
    found: dict[str, dict[str, Least]] = {}
    for (group, side), least in zip(names, every, strict=True):
        found.setdefault(group, {})[side] = least
    return found


def _listed(names: list[tuple[str, str]], margins: dict[str, dict[str, Margin]]) -> list[Margin]:
    return [margins[group][side] for group, side in names]


@compiled_soon(static=("turns", "every"))
def _scanned_margins(scanned: list[Margin], paths: list[ReferencePath | None], turns: int, every: int) -> Array:
    scan = scan_angles(turns, MARGIN_SCAN)
    at = Values(*(jnp.stack(part)[:, : every * scan.size : every] for part in zip(*scanned, strict=True)))
    start = scan_least(at, scan)
    for i, path in enumerate(paths):
        if path is not None:  # a gap in the path may lie between scan points
            unseen = path.ends() & (jnp.min(at.value[i]) > 0)
            start = start.at[i].set(jnp.where(unseen, path.middle(), start[i]))
    return start


@compiled_soon(static=("turns", "every"))
def _with_lowest(phi: Array, scanned: list[Margin], turns: int, every: int) -> Array:
    """The places of the least margins, and for each the lowest scan point: in a dwell of a motion law it is the least,
    and no step finds its end."""
    scan = scan_angles(turns, MARGIN_SCAN)
    at = jnp.stack([margin.value for margin in scanned])[:, : every * scan.size : every]
    return jnp.concatenate([phi, jnp.asarray(scan)[jnp.argmin(at, axis=1)]])


@compiled_soon(static=("loops",))
def _next_margins(phi: Array, start: Array, here: list[Margin], loops: tuple[bool, ...]) -> Array:
    step = 2 * math.pi / MARGIN_SCAN
    at = Values(*(jnp.diagonal(jnp.stack(part)) for part in zip(*here, strict=True)))
    return jnp.clip(towards_least(phi, at, np.asarray(loops)), start - step, start + step)


@compiled_soon(static=("turns",))
def _least_margins(phi: Array, here: list[Margin], back: list[Array | None], turns: int) -> list[Least]:
    angle, count = wrapped(phi, 2 * math.pi * turns), len(here)
    found = []
    for i, (margin, good) in enumerate(zip(here, back, strict=True)):
        value, where = margin.value[i], angle[i]
        if angle.size > count:
            lower = margin.value[count + i] < value
            value, where = jnp.where(lower, margin.value[count + i], value), jnp.where(lower, angle[count + i], where)
        value = value if good is None else jnp.where(good, value, jnp.minimum(value, -BEYOND))
        found.append(Least(value, where))
    return found


def stacked(ready: Prepared, phi: Array) -> Margin:
    """All margins at one crank angle, leaves of shape (margins,)."""
    at, groups = margins(ready, phi), named_groups(ready.mechanism)
    every = [at[name][side] for name, group in groups.items() for side in group.singular_positions()]
    return Margin(*(jnp.stack(part) for part in zip(*every, strict=True)))


def min_margin(mechanism: Mechanism | Prepared, cycle_turns: int = 1) -> Array:
    """The smallest of all assembly margins over the continuous cycle; positive if the machine can be assembled."""
    every = [least.value for sides in assembly_margins(mechanism, cycle_turns).values() for least in sides.values()]
    return smallest(jnp.stack(every)) if every else jnp.asarray(jnp.inf)
