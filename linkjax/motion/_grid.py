"""The cycle grid: panels that end wherever a load switches, a motion reverses or a dyad comes close to a dead position.

Breakpoints come from one coarse scan of the cycle, each reversal sharpened by one more evaluation. Slots without a
breakpoint are used to halve the hardest panels, so nothing is wasted and every shape is static.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax.kinematics import named_groups, pose
from linkjax.loads import AbstractLoad, Opposed
from linkjax.machine import Scene
from linkjax.motion._panels import Rule, rule

SCAN = 32  # scan points per crank turn
REVERSALS = 4  # reversals looked for per opposing load and cycle
SAME = 1e-7  # rad: breakpoints nearer than this are one; a kink so misplaced costs (1e-7)^2
KINK = 1e-6  # rad: a reversal with a singularity nearer than this is a true kink, smooth on either side
REACH = 0.35  # rad: singularities farther than this from the real axis need no breakpoint


class Grid(eqx.Module):
    """Panels of the cycle: `edges` (rad, increasing, one more than panels) with `n` Gauss nodes each."""

    edges: Float[Array, " edges"]
    overflow: Bool[Array, ""]
    n: int = eqx.field(static=True)
    evaluations: int = eqx.field(static=True)

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
        return self.middle[:, None] + self.half[:, None] * self.rule.x


class Candidates(NamedTuple):
    """Breakpoints with the distance of their singularity from the real axis (0: a kink; inf: none here)."""

    angle: Array
    distance: Array


def make_grid(scene: Scene, nodes: int) -> Grid:
    """Lay the grid for a scene with about `nodes` nodes in all (at least 4 per panel)."""
    windows = [end for load in scene.loads if load.window is not None for end in (load.window.on, load.window.off)]
    opposing = [load for load in scene.loads if load.opposing]
    groups = len(scene.mechanism.groups) - 1
    count = max(6, len(windows) + REVERSALS * len(opposing) + groups)
    scan = jnp.arange(SCAN * scene.cycle_turns) * (2 * math.pi / SCAN)
    motions, closeness = jax.vmap(lambda phi: _scan_at(scene, opposing, phi))(scan)
    found = [_reversals(scene, load, m, scan) for load, m in zip(opposing, motions, strict=True)]
    soft = [_closest(margins, scan) for margins in closeness]
    kinks = jax.lax.stop_gradient(_collect(scene, [*(f for f, _ in found), *soft]))  # exact: the torque is continuous there
    edges = _edges(scene, [jnp.mod(w, scene.cycle) for w in windows], kinks, count)
    overflow = jnp.any(jnp.stack([jnp.asarray(False), *(o for _, o in found)]))
    n = max(4, -(-nodes // count))
    return Grid(edges, overflow, n, scan.size + REVERSALS * len(opposing))


def _scan_at(scene, opposing, phi):
    here = pose(scene.mechanism, phi)
    motions = [load.opposed(here) for load in opposing]
    groups = list(named_groups(scene.mechanism).values())[1:]
    return motions, [list(g.margins(scene.mechanism.links, here.points).values()) for g in groups]


def _reversals(scene: Scene, load: AbstractLoad, motion: Opposed, scan: Array) -> tuple[Candidates, Array]:
    """Where the opposed motion reverses: in a cell whose end velocities point against each other."""
    step = scan[1] - scan[0]
    v0, a0 = jnp.stack(motion.v), jnp.stack(motion.a) * step
    v1, a1 = jnp.roll(v0, -1, axis=1), jnp.roll(a0, -1, axis=1)
    turn = v1 - v0
    along = turn * safe_divide(jnp.ones_like(turn[0]), safe_sqrt(jnp.sum(turn * turn, axis=0)))
    f0, f1, g0, g1 = (jnp.sum(part * along, axis=0) for part in (v0, v1, a0, a1))
    mask = jnp.sum(v0 * v1, axis=0) < 0
    x = safe_divide(-f0, f1 - f0, 0.5)
    for _ in range(3):  # Newton on the cell's cubic Hermite interpolant
        c2, c3 = 3 * (f1 - f0) - 2 * g0 - g1, g0 + g1 - 2 * (f1 - f0)
        value, slope = f0 + x * (g0 + x * (c2 + x * c3)), g0 + x * (2 * c2 + 3 * x * c3)
        x = jnp.clip(x - safe_divide(value, slope), 0.0, 1.0)
    start = scan + x * step
    if load.window is not None:
        mask = mask & (load.window.active(start, scene.cycle) > 0)
    place = jnp.cumsum(mask) - 1
    slot = mask & (place == jnp.arange(REVERSALS)[:, None])
    present = jnp.any(slot, axis=1)
    angle = jnp.sum(jnp.where(slot, start, 0.0), axis=1)

    def sharpen(phi):
        exact = load.opposed(pose(scene.mechanism, phi))
        assert exact is not None
        v, a = jnp.stack(exact.v), jnp.stack(exact.a)
        slope = jnp.sum(a * a)
        move = jnp.clip(safe_divide(jnp.sum(v * a), slope), -step, step)
        left = v - a * move
        return phi - move, safe_sqrt(safe_divide(jnp.sum(left * left), slope))

    angle, distance = jax.vmap(sharpen)(angle)
    return Candidates(angle, jnp.where(present, distance, jnp.inf)), jnp.sum(mask) > REVERSALS


def _closest(margins, scan: Array) -> Candidates:
    """A group's closest approach to a dead position: its margin vanishes a distance √(2m/m'') off the real axis."""
    step = scan[1] - scan[0]
    best = Candidates(jnp.zeros(()), jnp.asarray(jnp.inf))
    for margin in margins:
        at = jnp.argmin(margin.value)
        value, d, dd = margin.value[at], margin.d[at], jnp.maximum(margin.dd[at], 1e-12)
        move = jnp.clip(-d / dd, -step, step)
        least = jnp.maximum(value + move * (d + 0.5 * move * dd), 0.0)
        distance = jnp.sqrt(2 * least / dd)
        nearer = distance < best.distance
        best = Candidates(*(jnp.where(nearer, a, b) for a, b in zip((scan[at] + move, distance), best, strict=True)))
    return best


def _collect(scene: Scene, candidates: list[Candidates]) -> Candidates:
    """All kinks and near singularities in one list, angles modulo the cycle."""
    if not candidates:
        return Candidates(jnp.zeros((0,)), jnp.zeros((0,)))
    angle, distance = (jnp.concatenate([jnp.atleast_1d(c[i]) for c in candidates]) for i in (0, 1))
    return Candidates(jnp.mod(angle, scene.cycle), distance)


def _edges(scene: Scene, windows: list[Array], kinks: Candidates, count: int) -> Array:
    """Sorted edges; slots left over halve the panel that is widest for its distance to a singularity."""
    cycle = scene.cycle
    kept = list(windows)
    for k in range(kinks.angle.shape[0]):
        angle = kinks.angle[k]
        twin = [jnp.abs(jnp.mod(angle - other + 0.5 * cycle, cycle) - 0.5 * cycle) < SAME for other in kept]
        gone = jnp.any(jnp.stack([kinks.distance[k] > REACH, *twin]))
        kept.append(jnp.where(gone, jnp.inf, angle))
    kept += [jnp.asarray(jnp.inf)] * (count - len(kept))
    edges = jnp.sort(jnp.stack(kept))
    start = jnp.where(jnp.isfinite(edges[0]), edges[0], 0.0)
    edges = jnp.where(jnp.isfinite(edges), edges, start + cycle)
    edges = jnp.concatenate([edges.at[0].set(start), (start + cycle)[None]])
    for _ in range(count - max(1, len(windows))):
        edges = _halve(edges, kinks, cycle)
    return edges


def _halve(edges: Array, kinks: Candidates, cycle: float) -> Array:
    """Use one free slot (an empty panel at the end) to halve the hardest panel."""
    fixed = jax.lax.stop_gradient(edges)
    low, high = fixed[:-1], fixed[1:]
    width = high - low
    distance = jnp.ones_like(width)
    for k in range(kinks.angle.shape[0]):
        middle = 0.5 * (low + high)
        off = jnp.abs(jnp.mod(kinks.angle[k] - middle + 0.5 * cycle, cycle) - 0.5 * cycle)
        away = jnp.maximum(off - 0.5 * width, 0.0)
        near = jnp.where(kinks.distance[k] > KINK, kinks.distance[k], 1.0)  # beside a kink proper all is smooth
        distance = jnp.minimum(distance, jnp.sqrt(away * away + near * near))
    hardest = jnp.argmax(width / distance)
    free = fixed[-2] >= fixed[-1]
    cut = jnp.where(free, 0.5 * (low[hardest] + high[hardest]), jnp.inf)
    index = jnp.arange(edges.shape[0])
    shifted = jnp.concatenate([edges[:1], edges[:-1]])
    new = jnp.where(index <= hardest, edges, jnp.where(index == hardest + 1, cut, shifted))
    return jnp.where(free, new, edges)
