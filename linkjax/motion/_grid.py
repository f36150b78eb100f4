"""The cycle grid: panels end where a load switches, a motion reverses or a dyad is close to a singular position.

Breakpoints come from one coarse scan of the cycle; each reversal is refined by two more evaluations. The number of
edges is static: edges that are not needed for a breakpoint halve the most difficult panels.

Loads switch, and opposing loads reverse at dead centres, so ω(φ) has kinks there, and nodes inside a panel see a smooth
function.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from linkjax._compile import compiled_soon
from linkjax._numerics import highest, safe_divide, taken, wrapped
from linkjax._search import GRID_SCAN, Found, Motion, own, refined, scan_angles, scan_reversals, stacked_motions
from linkjax._tree import node
from linkjax.friction import motions, reversing
from linkjax.groups import Margin
from linkjax.kinematics import Pose, named_groups
from linkjax.loads import Passage, Window
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion._edges import (
    Candidates,
    Kinks,
    edges_of,
    extra,
    nearest,
    not_there,
    pick,
    switched,
    together,
    window_ends,
    wrapped_kinks,
)
from linkjax.motion._panels import Rule, rule
from linkjax.motion._windows import Passed, crossings_of, evaluated, how_many, kinks_at_most, passed
from linkjax.reduction import Reduced, loaded, of_crank
from linkjax.sampling import Sample, Sampler

REVERSALS = 4  # the most reversals per opposing load and crank turn
RUBS = 3  # reversals per joint with friction and crank turn, in the mean; each has at most as many as a load
ROUGH = 8  # the least nodes per panel with friction, whose many reversals make panels narrow
POLISH = 2  # evaluations that refine each of them; with friction one more, for their derivatives


@node
class Grid:
    """Panels of the cycle: `edges` (rad, increasing, one more than panels) with `n` Gauss nodes each; the `half` width
    and the `middle` of every panel (rad), and the `length` of the cycle (rad).

    `active` says which loads act in each panel. Where several loads switch at one angle there are panels of zero width
    between them, in which loads act as after all of them; in `order` they act as if they switched one after the other,
    so that an integral has the derivative of each switch by itself. `overflow` is true if there are more reversals than
    the grid has edges for. `doubt` bounds the error of the work (J) due to the position error of reversals. `passages`
    are the ranges of crank angle of the windows that are given by what happens, in the order of the loads. With
    `one_sided`, the acceleration of the motion law jumps at edges, so that the ends of panels lie just inside of them.
    The panels of a grid that is `divided` also end where forces have a kink. `guess` is a motion near the wanted one.
    """

    edges: Float[Array, " edges"]
    half: Float[Array, " panels"]
    middle: Float[Array, " panels"]
    active: Float[Array, "panels loads"]
    order: Float[Array, "panels loads"]
    overflow: Bool[Array, ""]
    doubt: Float[Array, ""]
    passages: tuple[Window, ...]
    guess: Any
    n: int = eqx.field(static=True)
    length: float = eqx.field(static=True)
    loads: tuple[str, ...] = eqx.field(static=True)
    prescribed: bool = eqx.field(static=True)
    one_sided: bool = eqx.field(static=True)
    breaks: tuple[float, ...] = eqx.field(static=True)
    evaluations: int = eqx.field(static=True)
    divided: bool = eqx.field(static=True, default=False)

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.n * self.panels

    @property
    def panels(self) -> int:
        """Number of panels."""
        return self.edges.shape[-1] - 1

    @property
    def rule(self) -> Rule:
        """The Gauss-Legendre rule used in every panel."""
        return rule(self.n)

    @property
    def nodes(self) -> Float[Array, "panels n"]:
        """Crank angles of the nodes (rad)."""
        return self.middle[:, None] + self.half[:, None] * self.rule.x[None]

    def place(self, phi: Array) -> Place:
        """The place of a crank angle; an edge belongs to the panel that begins there (the right-hand limit)."""
        start = self.edges[0]
        phi = start + wrapped(phi - start, self.length)
        nearly = phi + 8 * jnp.finfo(phi.dtype).eps * self.length  # an edge stays an edge despite rounding
        panel = jnp.clip(jnp.searchsorted(self.edges, nearly, side="right") - 1, 0, self.edges.size - 2)
        panel = panel.astype(jnp.int32)
        middle, half = taken(self.middle, panel), taken(self.half, panel)
        return Place(panel, jnp.clip(safe_divide(phi - middle, half), -1.0, 1.0), phi, middle)

    def at(self, panel: Int[Array, " *places"], x: Array) -> Place:
        """The place at the coordinate `x` of a panel."""
        middle, half = taken(self.middle, panel), taken(self.half, panel)
        if self.one_sided:
            half = half - jnp.minimum(half, 16 * jnp.finfo(half.dtype).eps * self.length)
        return Place(panel, x, middle + half * x, middle)

    def node_places(self) -> Place:
        """The nodes as places, every leaf of shape (panels, n)."""
        number, x = jnp.arange(self.panels, dtype=jnp.int32), jnp.asarray(self.rule.x)
        shape = self.nodes.shape
        panel, middle = jnp.broadcast_to(number[:, None], shape), jnp.broadcast_to(self.middle[:, None], shape)
        return Place(panel, jnp.broadcast_to(x[None], shape), self.nodes, middle)

    def loaded(self, dynamics: tuple, panel: Int[Array, " places"], active: Array | None = None) -> Reduced:
        """The reduced model at places in these panels, from `Sample.dynamics` there, which may be longer; each with the
        loads that act in its panel, by default those of `active`."""
        inertia, slope, shares = jax.tree.map(lambda leaf: leaf[: panel.shape[0]], dynamics)
        return loaded(inertia, slope, shares, self.loads, taken(self.active if active is None else active, panel))

    def reduced(self, dynamics: tuple, panel: Int[Array, " places"], active: Array | None = None) -> Reduced:
        """The same as it determines the motion of the crank."""
        return of_crank(self.loaded(dynamics, panel, active), self.prescribed)


class Place(NamedTuple):
    """A position on the grid: panel number, coordinate `x` in [-1, 1] within the panel, crank angle (rad), and an angle
    inside the panel (rad): limits at jumps are taken from this side."""

    panel: Int[Array, ""]
    x: Array
    phi: Array
    side: Array


class Plan(NamedTuple):
    """The fixed sizes of a grid: crank turns and their angle (rad), reversals per opposing load, edges, nodes per
    panel, scan points per turn, names of the loads, whether panels are halved in a loop, evaluations of the search
    for windows, and reversals of all joints with friction."""

    turns: int
    cycle: float
    slots: int
    panels: int
    n: int
    points: int
    loads: tuple[str, ...]
    prescribed: bool
    one_sided: bool
    breaks: tuple[float, ...]
    rolled: bool
    looked: int
    rubs: int

    @property
    def scan(self) -> np.ndarray:
        """The scan angles (rad)."""
        return scan_angles(self.turns, GRID_SCAN)


class Switches(NamedTuple):
    """Crank angles (rad) at which every load is switched on and off, None for a permanent one; kinks of the motion law;
    magnitudes of opposing loads; the windows that are given by what happens; and kinks of the motion (rad)."""

    windows: tuple[Window | None, ...]
    kinks: tuple[Any, ...]
    strengths: tuple[Array, ...]
    passed: Passed | None
    driven: Kinks | None


def make_grid(scene: Scene | ReadyScene, nodes: int) -> Grid:
    """The grid of a scene, with about `nodes` nodes per crank turn (at least 4 per panel)."""
    return grid_of(Sampler(ready(scene)), nodes)


def grid_of(
    machine: Sampler, nodes: int, scanned: Sample | None = None, points: int = GRID_SCAN,
    breaks: tuple[float, ...] = (), driven: Kinks | None = None,
) -> Grid:  # fmt: skip
    """The grid of a machine that is evaluated in batches; `scanned` are samples at `points` angles per turn, a multiple
    of `GRID_SCAN`, if known. Panels also end at the crank angles `breaks` (rad), and those of `driven`, near
    whose singularities they are smaller; infinite ones are not used."""
    scene, turns = machine.scene, machine.scene.cycle_turns
    opposing, rough = [load for load in scene.loads if load.opposing], reversing(scene.mechanism, scene.friction)
    kinks, groups = (*_kinks(scene), *breaks), list(named_groups(scene.mechanism))[1:]
    windows, crossed = sum(how_many(load.window, turns) for load in scene.loads), crossings_of(machine.ready)
    looked = evaluated([load.window for load in scene.loads if isinstance(load.window, Passage)] + crossed, turns)
    slots, passed_by = REVERSALS * turns, sum(kinks_at_most(each, turns) for each in crossed)
    more = 0 if driven is None else driven.ends.shape[0] + extra(driven.beside, scene.cycle)
    rubs = RUBS * turns * len(rough)
    count = 2 * windows + passed_by + len(kinks) + slots * len(opposing) + rubs + len(groups) * turns
    count = max(6 * turns, count)
    names = tuple(load.name for load in scene.loads)
    plan = Plan(
        turns,
        scene.cycle,
        slots,
        count + more,
        max(ROUGH, -(-nodes * turns // (count + more))) if rough else max(4, -(-nodes * turns // count)),
        points,
        names,
        scene.mechanism.prescribed,
        (law := scene.mechanism.driver.follows()) is not None and law.jumps(),
        breaks,
        not machine.traced,
        looked,
        rubs,
    )
    if scanned is None:
        plan = plan._replace(points=GRID_SCAN)
        scanned = machine.sample(plan.scan, fixed=True, dynamics=False, gaps=True)
    late = passed(machine, scanned, plan.points)
    ranges = iter(() if late is None else late.windows)
    acts = tuple(next(ranges) if isinstance(load.window, Passage) else load.window for load in scene.loads)
    switches = Switches(acts, kinks, tuple(load.strength() for load in opposing), late, driven)
    acting = tuple(window for load, window in zip(scene.loads, acts, strict=True) if load.opposing)
    acting += (None,) * len(rough)
    found, near = None, [list(scanned.margins[name].values()) for name in groups]
    if not opposing and not rough:
        return machine.run(_grid, switches, None, None, None, near, plan=plan)

    def moved(sample):
        against = tuple(motion for load in opposing if (motion := load.opposed(sample.pose)) is not None)
        return (*against, *machine.run(_rubs, scene, sample.pose)) if rough else against

    found, flat = machine.run(_scanned, moved(scanned), acting, plan=plan)
    angle = found.angle
    for _ in range(POLISH - 1 + bool(rough)):
        angle, flat = machine.run(_polished, angle, moved(machine.sample(flat, fixed=True, dynamics=False)), found)
    last = moved(machine.sample(flat, dynamics=False))
    return machine.run(_grid, switches, found, angle, last, near, plan=plan)


@compiled_soon
def _rubs(scene: Scene, pose: Pose) -> tuple[Motion, ...]:
    return motions(scene.mechanism, scene.friction, pose)


@compiled_soon(static=("plan",))
def _scanned(motions: tuple[Motion, ...], windows: tuple[Window | None, ...], plan: Plan) -> tuple[Found, Array]:
    """First guesses of the reversals of the motions that loads oppose, while these act."""

    def acting(start):
        rows = [window.active(at, plan.cycle) > 0 if window is not None else jnp.isfinite(at)
                for window, at in zip(windows, start, strict=True)]  # fmt: skip
        return jnp.stack(rows)

    v, a = (_thinned(part, plan) for part in stacked_motions(motions))
    found = scan_reversals(v, a, plan.scan, plan.slots, acting)
    return found, found.angle.ravel()


def _thinned(values: Array, plan: Plan) -> Array:
    """Values at the scan angles of the grid, from those at `plan.points` per turn."""
    return values[..., : plan.points * plan.turns : plan.points // GRID_SCAN]


@compiled_soon
def _polished(angle: Array, motions: tuple[Motion, ...], found: Found) -> tuple[Array, Array]:
    v, a = (own(part, angle.shape[1]) for part in stacked_motions(motions))
    angle = jax.lax.stop_gradient(refined(angle, v, a, 2 * math.pi / GRID_SCAN, found).angle)
    return angle, angle.ravel()


@compiled_soon(static=("plan",))
def _grid(
    switches: Switches,
    found: Found | None,
    angle: Array | None,
    motions: tuple[Motion, ...] | None,
    margins: list[list[Margin]],
    plan: Plan,
) -> Grid:
    """The grid, from its switches, the reversals before their last refinement, and the margins at the scan angles."""
    ends, sure = window_ends(switches.windows, plan.cycle)
    met = () if switches.passed is None else switches.passed.kinks
    kinks, overflow, doubt = Candidates(jnp.zeros(0), jnp.zeros(0)), jnp.asarray(False), jnp.zeros(())
    evaluations = plan.turns * GRID_SCAN + plan.looked
    if found is not None and angle is not None and motions is not None:
        v, a = (own(part, plan.slots) for part in stacked_motions(motions))
        turns = refined(angle, v, a, 2 * math.pi / GRID_SCAN, found)
        distance, loads = jnp.where(turns.present, turns.distance, jnp.inf), len(switches.strengths)
        kinks, overflow = Candidates(turns.angle[:loads].ravel(), distance[:loads].ravel()), jnp.any(turns.overflow)
        if plan.rubs:
            rubs, more = nearest(Candidates(turns.angle[loads:].ravel(), distance[loads:].ravel()), plan.rubs)
            kinks, overflow = together(kinks, rubs), overflow | more
        if loads:  # between the true and the computed angle of a reversal its load has the wrong sign
            wrong = jnp.sum(jnp.where(turns.present, turns.rate * turns.left**2, 0.0)[:loads], axis=1)
            doubt = jax.lax.stop_gradient(jnp.sum(jnp.abs(jnp.stack(switches.strengths)) * wrong))
        evaluations += (POLISH + bool(plan.rubs)) * turns.angle.size
    if switches.passed is not None:
        overflow, doubt = overflow | switches.passed.overflow, doubt + switches.passed.doubt
    soft = jax.lax.stop_gradient(_closest(margins, plan))
    kinks = together(kinks, soft)
    kinks = kinks._replace(angle=wrapped(kinks.angle, plan.cycle))
    sure += len(switches.kinks) - len(plan.breaks)
    fixed = [*ends, *(wrapped(jnp.asarray(kink), plan.cycle) for kink in switches.kinks[: -len(plan.breaks) or None])]
    # an edge that moves must not have a twin that does not: which of them is the place of a peak could not be seen
    fixed += not_there(plan.breaks, fixed, plan.cycle)
    fixed += [each for kinks_of_load in met for each in wrapped_kinks(kinks_of_load, plan.cycle)]
    driven = switches.driven
    fixed += [] if driven is None else wrapped_kinks(driven.ends, plan.cycle)
    beside = None if driven is None else driven.beside
    edges = edges_of(fixed, kinks, beside, plan.panels, plan.cycle, plan.rolled, sure)
    order = _order(switches.windows, switched(edges, ends), plan)
    half, middle = 0.5 * (edges[1:] - edges[:-1]), 0.5 * (edges[1:] + edges[:-1])
    return Grid(
        edges,
        half,
        middle,
        _active(switches.windows, middle, plan),
        order,
        overflow,
        doubt,
        () if switches.passed is None else switches.passed.windows,
        None,
        plan.n,
        plan.cycle,
        plan.loads,
        plan.prescribed,
        plan.one_sided,
        plan.breaks,
        evaluations,
    )


def _kinks(scene: Scene) -> tuple[Any, ...]:
    """Crank angles where the motion law of the driver, or a load, has a kink, over the whole cycle."""
    own = tuple(angle for load in scene.loads for angle in load.kinks(scene.cycle))
    law = scene.mechanism.driver.follows()
    return own if law is None else (*law.every_break(scene.cycle), *own)


def _closest(margins: list[list[Margin]], plan: Plan) -> Candidates:
    """Closest approach of every group to a singular position in every turn: its margin is zero at √(2m/m'') off the
    real axis."""
    sides = [side for group in margins for side in group]
    if not sides:
        return Candidates(jnp.zeros(0), jnp.zeros(0))
    step, scan = 2 * math.pi / GRID_SCAN, plan.scan.reshape((1, plan.turns, GRID_SCAN))
    rows = [_thinned(jnp.stack(part), plan) for part in zip(*sides, strict=True)]
    value, d, dd = (part.reshape((len(sides), plan.turns, GRID_SCAN)) for part in rows)
    least = jax.vmap(jax.vmap(highest))(-value)
    at, value, d, dd = (pick(least, part) for part in (jnp.broadcast_to(scan, value.shape), value, d, dd))
    dd = jnp.maximum(dd, 1e-12)
    move = jnp.clip(-d / dd, -step, step)
    distance = jnp.sqrt(2 * jnp.maximum(value + move * (d + 0.5 * move * dd), 0.0) / dd)
    found, first = [], 0
    for group in margins:
        best, first = Candidates(jnp.zeros(plan.turns), jnp.full(plan.turns, jnp.inf)), first + len(group)
        for i in range(first - len(group), first):
            nearer = distance[i] < best.distance
            best = Candidates(
                *(jnp.where(nearer, a, b) for a, b in zip((at[i] + move[i], distance[i]), best, strict=True))
            )
        found.append(best)
    return Candidates(*(jnp.concatenate(part) for part in zip(*found, strict=True)))


def _active(windows: tuple[Window | None, ...], middle: Array, plan: Plan) -> Float[Array, "panels loads"]:
    """One where a load acts in the middle of a panel, zero otherwise."""
    ones = jnp.ones_like(middle)
    columns = [ones if window is None else window.active(middle, plan.cycle) for window in windows]
    return jnp.stack(columns, axis=1) if columns else jnp.zeros((plan.panels, 0))


def _order(windows: tuple[Window | None, ...], switched: Array, plan: Plan) -> Float[Array, "panels loads"]:
    """The same by the numbers of the panels that begin where a window begins or ends, not by angles. Ranges of one load
    that touch overlap in a panel of zero width: it counts there twice, so that each end has its own derivative."""
    panels, columns, ends = jnp.arange(plan.panels, dtype=jnp.int32), [], iter(range(0, switched.size, 2))
    for window in windows:
        if window is None:
            columns.append(jnp.ones(plan.panels))
            continue
        parts = []
        for one in window.ranges:
            first = next(ends)
            on, off = switched[first], switched[first + 1]
            acts = jnp.mod(panels - on, plan.panels) < jnp.mod(off - on, plan.panels)
            acts = acts if one is window else acts & (one.on != one.off)
            parts.append(jnp.where(acts, 1.0, 0.0))
        columns.append(parts[0] if len(parts) == 1 else jnp.sum(jnp.stack(parts), axis=0))
    return jnp.stack(columns, axis=1) if columns else jnp.zeros((plan.panels, 0))
