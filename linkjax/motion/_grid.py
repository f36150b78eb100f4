"""The cycle grid: panels end where a load switches, a motion reverses or a dyad is close to a singular position.

Breakpoints come from one coarse scan of the cycle; each reversal is refined by two more evaluations. The number of
edges is static: edges that are not needed for a breakpoint halve the most difficult panels.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from linkjax._numerics import highest, nearest_turn, safe_divide, wrapped
from linkjax.groups import Margin
from linkjax.kinematics import Motion, find_reversals, named_groups, pose, scan_angles
from linkjax.loads import AbstractLoad, Window
from linkjax.machine import Scene, ready
from linkjax.motion._panels import Rule, rule

SCAN = 32  # scan points per crank turn
REVERSALS = 4  # the most reversals per opposing load and crank turn
POLISH = 2  # evaluations that refine each of them
SAME = 1e-7  # rad: closer breakpoints are merged; a kink with this error of position costs (1e-7)^2
KINK = 1e-6  # rad: a reversal with a closer singularity is a kink, smooth on either side
REACH = 0.35  # rad: singularities farther than this from the real axis need no breakpoint


class Grid(eqx.Module):
    """Panels of the cycle: `edges` (rad, increasing, one more than panels) with `n` Gauss nodes each.

    `overflow` is true if there are more reversals than the grid has edges for. `doubt` bounds the error of the work (J)
    due to the position error of reversals. `switches` are the numbers of the panels that begin where a load's window
    begins or ends, in the order of the loads; several at one angle have panels of zero width between them.
    """

    edges: Float[Array, " edges"]
    switches: Int[Array, " ends"]
    overflow: Bool[Array, ""]
    doubt: Float[Array, ""]
    n: int = eqx.field(static=True)
    evaluations: int = eqx.field(static=True)

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.n * (self.edges.shape[-1] - 1)

    @property
    def rule(self) -> Rule:
        """The Gauss-Legendre rule used in every panel."""
        return rule(self.n)

    @property
    def half(self) -> Float[Array, " panels"]:
        """Half widths (rad)."""
        return 0.5 * (self.edges[1:] - self.edges[:-1])

    @property
    def middle(self) -> Float[Array, " panels"]:
        """Middles (rad)."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    @property
    def nodes(self) -> Float[Array, "panels n"]:
        """Crank angles of the nodes (rad)."""
        return self.middle[:, None] + self.half[:, None] * self.rule.x[None]

    def in_order(self, scene: Scene) -> Scene:
        """The scene with windows given by panel numbers, mapped evenly onto the cycle; `orders` is the side. In panels
        of zero width this decides which loads act, so that an integral has the derivative of each switch by itself. Use
        it only for the reduced torque: that side is not a crank angle, and gives no direction of motion.
        """
        ends = iter(self.switches.astype(float) * (scene.cycle / self.half.size))
        loads = tuple(
            load if load.window is None else dataclasses.replace(load, window=Window(next(ends), next(ends)))
            for load in scene.loads
        )
        return dataclasses.replace(scene, loads=loads)

    def orders(self, scene: Scene) -> Float[Array, " panels"]:
        """The middle of every panel (rad) if all panels had equal widths."""
        return (jnp.arange(self.half.size, dtype=float) + 0.5) * (scene.cycle / self.half.size)

    def place(self, phi: Array) -> Place:
        """The place of a crank angle; an edge belongs to the panel that begins there (the right-hand limit)."""
        start, cycle = self.edges[0], self.edges[-1] - self.edges[0]
        phi = start + wrapped(phi - start, cycle)
        nearly = phi + 8 * jnp.finfo(phi.dtype).eps * cycle  # an edge stays an edge despite rounding
        panel = jnp.clip(jnp.searchsorted(self.edges, nearly, side="right") - 1, 0, self.edges.size - 2)
        panel = panel.astype(jnp.int32)
        return Place(panel, jnp.clip(safe_divide(phi - self.middle[panel], self.half[panel]), -1.0, 1.0), phi)

    def node_places(self) -> Place:
        """The nodes as places, every leaf of shape (panels, n)."""
        panel, x = jnp.meshgrid(jnp.arange(self.half.size, dtype=jnp.int32), jnp.asarray(self.rule.x), indexing="ij")
        return Place(panel, x, self.nodes)


class Place(NamedTuple):
    """A position on the grid: panel number, coordinate `x` in [-1, 1] within the panel, and crank angle (rad)."""

    panel: Int[Array, ""]
    x: Array
    phi: Array


class Candidates(NamedTuple):
    """Breakpoints with the distance of their singularity from the real axis (0: a kink; inf: no breakpoint)."""

    angle: Array
    distance: Array


def make_grid(scene: Scene, nodes: int) -> Grid:
    """The grid of a scene, with about `nodes` nodes per crank turn (at least 4 per panel)."""
    scene = ready(scene)
    windows = [end for load in scene.loads if load.window is not None for end in (load.window.on, load.window.off)]
    windows = [wrapped(end, scene.cycle) for end in windows]
    breaks = [wrapped(jnp.asarray(angle), scene.cycle) for angle in _breaks(scene)]
    opposing = [load for load in scene.loads if load.opposing]
    groups = len(scene.mechanism.groups) - 1
    turns, slots = scene.cycle_turns, REVERSALS * scene.cycle_turns
    count = max(6 * turns, len(windows) + len(breaks) + slots * len(opposing) + groups * turns)
    scan = scan_angles(turns, SCAN)
    motions, closeness = jax.vmap(lambda phi: _scan_at(scene, opposing, phi))(scan)
    found = [_reversals(scene, load, m, scan) for load, m in zip(opposing, motions, strict=True)]
    by_turn = jax.tree.map(lambda leaf: leaf.reshape(turns, SCAN), (closeness, scan))
    soft = [
        _closest(*jax.tree.map(lambda leaf, turn=turn: leaf[turn], (margins, by_turn[1])))
        for margins in by_turn[0]
        for turn in range(turns)
    ]
    kinks = _collect(scene, [*(f[0] for f in found), *jax.lax.stop_gradient(soft)])
    edges = _edges(scene, windows + breaks, kinks, count)
    overflow = jnp.any(jnp.stack([jnp.asarray(False), *(f[1] for f in found)]))
    doubt = sum((f[2] for f in found), jnp.zeros(()))
    n = max(4, -(-nodes * turns // count))
    return Grid(edges, _switches(edges, windows), overflow, doubt, n, scan.size + POLISH * slots * len(opposing))


def _breaks(scene: Scene) -> list[float]:
    """Crank angles where the motion law of the driver has a kink, over the whole cycle."""
    law = scene.mechanism.driver.follows()
    if law is None:
        return []
    times = round(scene.cycle / law.period())
    return [angle + k * law.period() for k in range(times) for angle in law.breaks()]


def _scan_at(scene, opposing, phi):
    here = pose(scene.mechanism, phi)
    motions = [motion for load in opposing if (motion := load.opposed(here)) is not None]
    groups = list(named_groups(scene.mechanism).values())[1:]
    return motions, [list(g.margins(scene.mechanism.held_by(g), here.links, here.points, phi).values()) for g in groups]


def _reversals(scene: Scene, load: AbstractLoad, scanned: Motion, scan: Array) -> tuple[Candidates, Array, Array]:
    """Reversals of the motion that a load opposes while the load acts; whether there are too many; and the error of the
    work (J) due to their position error: between the true and the computed angle the load has the wrong sign."""

    def motion(phi):
        here = load.opposed(pose(scene.mechanism, phi))
        assert here is not None  # only called for opposing loads
        return here

    def on(angle):
        return jnp.isfinite(angle) if load.window is None else load.window.active(angle, scene.cycle) > 0

    found = find_reversals(motion, scanned, scan, REVERSALS * scene.cycle_turns, POLISH, on)
    wrong = jnp.abs(load.strength()) * jnp.sum(jnp.where(found.present, found.rate * found.left**2, 0.0))
    kinks = Candidates(found.angle, jnp.where(found.present, found.distance, jnp.inf))
    return kinks, found.overflow, jax.lax.stop_gradient(wrong)


def _closest(margins: list[Margin], scan: Array) -> Candidates:
    """A group's closest approach to a singular position: its margin is zero at √(2m/m'') off the real axis."""
    step = scan[1] - scan[0]
    best = Candidates(jnp.zeros(()), jnp.asarray(jnp.inf))
    for margin in margins:
        least = highest(-margin.value)
        at, value, d, dd = (_pick(least, part) for part in (scan, margin.value, margin.d, margin.dd))
        dd = jnp.maximum(dd, 1e-12)
        move = jnp.clip(-d / dd, -step, step)
        distance = jnp.sqrt(2 * jnp.maximum(value + move * (d + 0.5 * move * dd), 0.0) / dd)
        nearer = distance < best.distance
        best = Candidates(*(jnp.where(nearer, a, b) for a, b in zip((at + move, distance), best, strict=True)))
    return best


def _pick(mask: Array, values: Array) -> Array:
    """The largest masked value; a maximum is much cheaper than a gather on a CPU."""
    return jnp.max(jnp.where(mask, values, -jnp.inf))


def _collect(scene: Scene, candidates: list[Candidates]) -> Candidates:
    """All kinks and near singularities in one list, angles modulo the cycle."""
    if not candidates:
        return Candidates(jnp.zeros((0,)), jnp.zeros((0,)))
    angle, distance = (jnp.concatenate([jnp.atleast_1d(c[i]) for c in candidates]) for i in (0, 1))
    return Candidates(wrapped(angle, scene.cycle), distance)


def _edges(scene: Scene, windows: list[Array], kinks: Candidates, count: int) -> Array:
    """Sorted edges; each spare edge halves the panel that is widest relative to its distance from a singularity."""
    cycle = scene.cycle
    kept = list(windows)
    for k in range(kinks.angle.shape[0]):
        angle = kinks.angle[k]
        twin = [jnp.abs(nearest_turn(angle - other, cycle)) < SAME for other in kept]
        gone = jnp.any(jnp.stack([kinks.distance[k] > REACH, *twin]))
        kept.append(jnp.where(gone, jnp.inf, angle))
    kept += [jnp.asarray(jnp.inf)] * (count - len(kept))
    edges = _sorted(jnp.stack(kept))
    start = jnp.where(jnp.isfinite(edges[0]), edges[0], 0.0)
    edges = jnp.where(jnp.isfinite(edges), edges, start + cycle)
    edges = jnp.concatenate([edges.at[0].set(start), (start + cycle)[None]])
    for _ in range(count - max(1, len(windows))):
        edges = _halve(edges, kinks, cycle)
    return edges


def _sorted(values: Array) -> Array:
    """A few values in order, by counting, because a sort is slow on a CPU."""
    number = jnp.arange(values.size)
    before = (values[None] < values[:, None]) | ((values[None] == values[:, None]) & (number[None] < number[:, None]))
    place = jnp.sum(before, axis=1)
    return jnp.max(jnp.where(place[None] == number[:, None], values[None], -jnp.inf), axis=1)


def _switches(edges: Array, ends: list[Array]) -> Int[Array, " ends"]:
    """The edge number of every window end; ends at one angle get consecutive edges."""
    if not ends:
        return jnp.zeros((0,), jnp.int32)
    found, number = jnp.stack(ends), jnp.arange(len(ends))
    before = jnp.sum(edges[None] < found[:, None], axis=1)
    twins = jnp.sum((found[None] == found[:, None]) & (number[None] < number[:, None]), axis=1)
    return (before + twins).astype(jnp.int32)


def _halve(edges: Array, kinks: Candidates, cycle: float) -> Array:
    """Use one spare edge (an empty panel at the end) to halve the panel that is widest relative to its distance from a
    singularity."""
    fixed = jax.lax.stop_gradient(edges)
    low, high = fixed[:-1], fixed[1:]
    width = high - low
    kinks = jax.lax.stop_gradient(kinks)
    near = jnp.where(kinks.distance > KINK, kinks.distance, 1.0)  # on either side of a kink the function is smooth
    off = nearest_turn(kinks.angle[None] - 0.5 * (low + high)[:, None], cycle)
    away = jnp.maximum(jnp.abs(off) - 0.5 * width[:, None], 0.0)
    squared = jnp.minimum(jnp.min(away * away + (near * near)[None], axis=1, initial=1.0), 1.0)
    hard = width * width / squared
    hardest = highest(hard)
    free = fixed[-2] >= fixed[-1]
    cut = _pick(hardest, 0.5 * (low + high))
    after = jnp.concatenate([edges[:1], edges[:-1]])
    new = jnp.where(edges <= cut, edges, jnp.where(jnp.concatenate([edges[:1], edges[:-1]]) <= cut, cut, after))
    return jnp.where(free, new, edges)
