"""Results over the whole cycle, refined between scan points: reversals of motion (dead centres) and least margins."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from linkjax._numerics import largest, nearest_turn, repeat, safe_divide, safe_sqrt, smallest, wrapped
from linkjax.groups import BEYOND, Crank, Margin, Track
from linkjax.kinematics._pose import check_mechanism, margins, named_groups, pose, prepared
from linkjax.mechanism import Mechanism

DEAD_CENTRES = 8  # slots per link and crank turn
MARGIN_SCAN = 64  # scan points per turn for the least margins
SHARPEN = 4  # Newton steps from the best scan point
KINK = 10.0  # d² / (value dd): two at most near the minimum of a parabola; above this the margin reaches zero
REAL = 1e-6  # rad: largest distance of a true reversal from the real axis
BEND = 30.0  # 1/rad: the last Newton step squared, times this, bounds the error of a reversal


class Motion(NamedTuple):
    """Velocity and acceleration coefficients of a point or link, component by component."""

    v: tuple[Array, ...]
    a: tuple[Array, ...]


class Reversals(NamedTuple):
    """Crank angles `angle` (rad) at which a motion reverses, in a fixed number of slots; unused ones are not `present`.

    `distance` (rad) is the distance from the real axis to the zero of the speed: zero for a true reversal, larger for a
    point that only slows down. `left` (rad) bounds the error of the angle, `rate` is the magnitude of the acceleration
    coefficient there, and `overflow` says that there are more reversals than slots.
    """

    angle: Float[Array, " slots"]
    distance: Float[Array, " slots"]
    present: Bool[Array, " slots"]
    left: Float[Array, " slots"]
    rate: Float[Array, " slots"]
    overflow: Bool[Array, ""]

    @property
    def true(self) -> Any:
        """Which slots hold a true reversal, not only a minimum of the speed."""
        return self.present & (self.distance < REAL)


def find_reversals(
    motion: Callable[[Array], Motion],
    scanned: Motion,
    scan: Float[Array, " scan"],
    slots: int,
    steps: int,
    wanted: Callable[[Array], Array] = jnp.isfinite,
) -> Reversals:
    """Reversals of a motion over the cycle, sought in the scan cells in which the velocity changes direction.

    `scanned` holds the motion at the uniform `scan` angles (components first). Each angle is refined by `steps`
    evaluations of `motion`. At most `slots` are kept; more set `overflow`. `wanted` filters by angle.
    """
    step = scan[1] - scan[0]
    v0, a0 = jnp.stack(scanned.v), jnp.stack(scanned.a) * step
    v1, a1 = jnp.roll(v0, -1, axis=1), jnp.roll(a0, -1, axis=1)
    single, x = _single_root(v0, a0, v1, a1)
    double, near, far = _double_root(v0, a0, v1, a1)
    start = jnp.concatenate([scan + step * jnp.where(double, near, x), scan + step * far])
    mask = jnp.concatenate([single | double, double]) & wanted(start)
    place = jnp.cumsum(mask)
    number = jnp.arange(1, slots + 1)
    angle = jnp.sum(jnp.where(mask[None] & (place[None] == number[:, None]), start[None], 0.0), axis=1)

    def sharpen(at):
        here = jax.vmap(motion)(at)
        v, a = jnp.stack(here.v), jnp.stack(here.a)
        slope = jax.lax.stop_gradient(jnp.sum(a * a, axis=0))
        move = jnp.clip(safe_divide(jnp.sum(v * a, axis=0), slope), -step, step)
        left = jax.lax.stop_gradient(v - a * move[None])
        return at - move, safe_sqrt(safe_divide(jnp.sum(left * left, axis=0), slope)), jnp.abs(move), safe_sqrt(slope)

    angle = jax.lax.stop_gradient(angle)
    if steps > 1:
        angle = jax.lax.stop_gradient(jax.lax.fori_loop(0, steps - 1, lambda _, at: sharpen(at)[0], angle))
    # the last step carries the derivative of a reversal that moves with the design
    angle, distance, moved, rate = sharpen(angle)
    left = jax.lax.stop_gradient(jnp.minimum(moved, BEND * moved**2))
    return Reversals(angle, distance, place[-1] >= number, left, rate, place[-1] > slots)


def _single_root(v0: Array, a0: Array, v1: Array, a1: Array) -> tuple[Array, Array]:
    """Cells in which the motion reverses once, and the place in them (0…1): a root of the cubic Hermite interpolant."""
    turn = v1 - v0
    along = turn * safe_divide(jnp.ones_like(turn[0]), safe_sqrt(jnp.sum(turn * turn, axis=0)))[None]
    f0, f1, g0, g1 = (jnp.sum(part * along, axis=0) for part in (v0, v1, a0, a1))
    x = safe_divide(-f0, f1 - f0)
    c2, c3 = 3 * (f1 - f0) - 2 * g0 - g1, g0 + g1 - 2 * (f1 - f0)
    for _ in range(3):
        value, slope = f0 + x * (g0 + x * (c2 + x * c3)), g0 + x * (2 * c2 + 3 * x * c3)
        x = jnp.clip(x - safe_divide(value, slope), 0.0, 1.0)
    stopped = (jnp.sum(v0 * v0, axis=0) == 0) & (jnp.sum(a0 * a0, axis=0) > 0)  # a scan point at a reversal
    return (jnp.sum(v0 * v1, axis=0) < 0) | stopped, x


def _double_root(v0: Array, a0: Array, v1: Array, a1: Array) -> tuple[Array, Array, Array]:
    """Cells in which the motion reverses twice, and the two places: the Hermite interpolant falls below zero."""
    mean = v0 + v1
    along = mean * safe_divide(jnp.ones_like(mean[0]), safe_sqrt(jnp.sum(mean * mean, axis=0)))[None]
    f0, f1, g0, g1 = (jnp.sum(part * along, axis=0) for part in (v0, v1, a0, a1))
    c2, c3 = 3 * (f1 - f0) - 2 * g0 - g1, g0 + g1 - 2 * (f1 - f0)
    x = safe_divide(-g0, g1 - g0)
    for _ in range(2):
        x = jnp.clip(x - safe_divide(g0 + x * (2 * c2 + 3 * x * c3), 2 * c2 + 6 * x * c3), 0.0, 1.0)
    least, bend = f0 + x * (g0 + x * (c2 + x * c3)), 2 * c2 + 6 * x * c3
    dips = (f0 > 0) & (f1 > 0) & (g0 < 0) & (g1 > 0) & (least < 0) & (bend > 0)
    reach = safe_sqrt(safe_divide(-2 * least, bend))
    return dips, jnp.clip(x - reach, 0.0, 1.0), jnp.clip(x + reach, 0.0, 1.0)


def scan_angles(cycle_turns: int, points: int) -> Float[Array, " scan"]:
    """Uniform crank angles (rad) over `cycle_turns` turns, `points` per turn, without the end."""
    return jnp.arange(points * cycle_turns, dtype=float) * (2 * math.pi / points)


def dead_centres(mechanism: Mechanism, cycle_turns: int = 1) -> dict[str, Reversals]:
    """Dead centres of sliders and limit positions of rockers, over `cycle_turns` turns of the crank.

    Returns {name: `Reversals`} for the pin of every slider on a guide of the frame and for every link pivoted on the
    frame, except a crank that drives without a motion law. Crank angles are in rad, accurate to rounding, in
    8 `cycle_turns` slots each; `Reversals.true` selects the used ones. If the mechanism cannot be assembled over the
    whole cycle, the values are finite but meaningless. Differentiable with respect to the design.
    """
    check_mechanism(mechanism)
    ends = _stopping_ends(mechanism)
    if not ends:
        return {}
    mechanism = prepared(mechanism, cycle_turns)
    scan = scan_angles(cycle_turns, 2 * MARGIN_SCAN)
    whole = jax.vmap(lambda phi: _motions(mechanism, ends, phi))(scan)  # leaves (scan, ends)

    def one(number):
        def motion(phi):
            return jax.tree.map(lambda leaf: leaf[number], _motions(mechanism, ends, phi))

        return find_reversals(
            motion, jax.tree.map(lambda leaf: leaf[:, number], whole), scan, DEAD_CENTRES * cycle_turns, 3
        )

    found = jax.vmap(one)(jnp.arange(len(ends)))
    return {name: Reversals(*(leaf[i] for leaf in found)) for i, name in enumerate(ends)}


def strokes(mechanism: Mechanism, found: dict[str, Reversals], cycle_turns: int = 1) -> dict[str, Array]:
    """Strokes of sliders (m) and swing angles of rockers (rad), by the names of `dead_centres`.

    `found` is the result of `dead_centres` for the same `mechanism` and `cycle_turns`. The stroke of a slider is the
    distance between its outermost dead centres. A link or slider that never reverses has zero; a link that reverses
    but also makes full rotations has NaN.
    """
    if not found:
        return {}
    mechanism, ends = prepared(mechanism, cycle_turns), _stopping_ends(mechanism)
    scan = scan_angles(cycle_turns, 2 * MARGIN_SCAN)
    whole = jax.vmap(lambda phi: _places(mechanism, ends, phi))(scan)  # (scan, ends, 2)
    at = jnp.stack([found[name].angle for name in ends])
    there = jax.vmap(jax.vmap(lambda phi: _places(mechanism, ends, phi)))(at)  # (ends, slots, ends, 2)
    covered = {}
    for i, (name, slides) in enumerate(ends.items()):
        true, place = found[name].true, there[i, :, i]
        both = true[:, None] & true[None, :]
        if slides:
            apart = place[:, None] - place[None, :]
            reach = safe_sqrt(jnp.sum(apart * apart, axis=-1))
        else:
            coarse = jnp.unwrap(jnp.arctan2(whole[:, i, 1], whole[:, i, 0]))
            near = coarse[jnp.round(at[i] / scan[1]).astype(int) % scan.size]
            turned = near + nearest_turn(jnp.arctan2(place[:, 1], place[:, 0]) - near, 2 * math.pi)
            rest = nearest_turn(coarse[0] - coarse[-1], 2 * math.pi)
            net = jnp.abs(coarse[-1] + rest - coarse[0])  # a link that rotates fully has no swing
            reach = jnp.where(net < math.pi, turned[:, None] - turned[None, :], jnp.nan)
        covered[name] = largest(jnp.where(both, reach, 0.0))
    return covered


def _places(mechanism: Mechanism, ends: dict[str, bool], phi: Array) -> Float[Array, "ends 2"]:
    """Position (m) of every pin and direction of every link in `ends`."""
    here = pose(mechanism, phi)
    at = [here.points[name].r if slides else here.links[name].u for name, slides in ends.items()]
    return jnp.stack([jnp.stack([v.x, v.y]) for v in at])


def _stopping_ends(mechanism: Mechanism) -> dict[str, bool]:
    """Pins of sliders (True) and links pivoted on the frame (False), without a driving crank that has no motion law."""
    ends, turning = {}, isinstance(mechanism.driver, Crank) and not mechanism.prescribed
    for group in mechanism.groups[turning:]:
        ends |= {joint.point: True for joint in group.joints() if joint.slides and joint.by == "frame"}
        for link, pins in group.pins().items():
            pins = (*pins, *mechanism.links[link].pins)
            if any(pin in mechanism.fixed for pin in pins) and link not in group.translating():
                ends[link] = False
    return ends


def _motions(mechanism: Mechanism, ends: dict[str, bool], phi: Array) -> Motion:
    """Motion of every pin and link in `ends` at one crank angle, leaves of shape (ends,)."""
    here = pose(mechanism, phi)
    still = jnp.zeros_like(phi)
    rows = []
    for name, slides in ends.items():
        if slides:
            p = here.points[name]
            rows.append((p.dr.x, p.dr.y, p.ddr.x, p.ddr.y))
        else:
            rows.append((here.links[name].w, still, here.links[name].e, still))
    columns = [jnp.stack(column) for column in zip(*rows, strict=True)]
    return Motion((columns[0], columns[1]), (columns[2], columns[3]))


class Least(NamedTuple):
    """Least value of a margin over the continuous cycle, and the crank angle (rad) where it occurs."""

    value: Array
    angle: Array


def assembly_margins(mechanism: Mechanism, cycle_turns: int = 1) -> dict[str, dict[str, Least]]:
    """Least signed margin of every group to each of its singular positions over the continuous cycle.

    Returns {group: {side: `Least`}}. Margins are dimensionless; a negative one is the shortfall of a group that cannot
    be assembled. Values and gradients are always finite, and the gradient points towards designs that can be assembled.
    """
    check_mechanism(mechanism)
    names = [(name, side) for name, group in named_groups(mechanism).items() for side in group.singular_positions()]
    if not names:
        return {}
    mechanism = prepared(mechanism, cycle_turns)
    scan = scan_angles(cycle_turns, MARGIN_SCAN)
    step = scan[1] - scan[0]
    fixed = jax.lax.stop_gradient(mechanism)
    scanned = jax.vmap(lambda phi: stacked(fixed, phi))(scan)  # leaves (scan, margins)
    start = jax.vmap(lambda m: _lowest(m, scan), in_axes=1)(scanned)
    for i, (group, side) in enumerate(names):
        path = getattr(named_groups(mechanism)[group], "path", None)
        if isinstance(path, Track) and side == "loops":  # a gap in the path may lie between scan points
            unseen = path.ends() & (jnp.min(scanned.value[:, i]) > 0)
            start = start.at[i].set(jnp.where(unseen, path.middle(), start[i]))

    loops = jnp.asarray([side == "loops" for _, side in names])  # singular values, which have no sign

    def sharpen(_, phi):
        here = jax.tree.map(jnp.diagonal, jax.vmap(lambda one: stacked(fixed, one))(phi))
        bend = jnp.where(here.dd > 0, here.dd, jnp.abs(here.d) + 1.0)
        kink = loops & (here.d * here.d > KINK * here.value * jnp.maximum(here.dd, 0.0))  # it reaches zero
        move = jnp.where(kink & (here.value > 0), safe_divide(here.value, here.d), here.d / bend)
        return jnp.clip(phi - move, start - step, start + step)

    phi = repeat(SHARPEN, sharpen, start)
    value = jnp.diagonal(jax.vmap(lambda one: stacked(mechanism, one))(phi).value)
    angle = wrapped(phi, scan.size * step)
    result: dict[str, dict[str, Least]] = {}
    groups = named_groups(mechanism)
    for i, (group, side) in enumerate(names):
        back = None if side == "apart" else groups[group].returns()
        least = value[i] if back is None else jnp.where(back, value[i], jnp.minimum(value[i], -BEYOND))
        result.setdefault(group, {})[side] = Least(least, angle[i])
    return result


def stacked(mechanism: Mechanism, phi: Array) -> Margin:
    """All margins at one crank angle, leaves of shape (margins,)."""
    at, groups = margins(mechanism, phi), named_groups(mechanism)
    every = [at[name][side] for name, group in groups.items() for side in group.singular_positions()]
    return Margin(*(jnp.stack(part) for part in zip(*every, strict=True)))


def _lowest(margin: Margin, scan: Array) -> Array:
    """Predicted crank angle of the least margin: the lowest point of the local parabolas at the scan points."""
    step = scan[1] - scan[0]
    move = jnp.clip(-margin.d / jnp.maximum(margin.dd, 1e-9), -step, step)
    predicted = margin.value + move * (margin.d + 0.5 * move * margin.dd)
    best = jnp.argmin(jnp.minimum(predicted, margin.value))
    return scan[best] + move[best]


def min_margin(mechanism: Mechanism, cycle_turns: int = 1) -> Array:
    """The smallest of all assembly margins over the continuous cycle; positive if the machine can be assembled."""
    every = [least.value for sides in assembly_margins(mechanism, cycle_turns).values() for least in sides.values()]
    return smallest(jnp.stack(every)) if every else jnp.asarray(jnp.inf)
