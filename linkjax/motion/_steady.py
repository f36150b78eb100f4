"""Steady periodic motion for a constant balancing drive torque, by quadrature of the energy equation.

With torques that depend on position only, ½ J ω² = E₀ + W(φ), W = ∫ (Q + T) dφ: no differential equation is left. W is
smooth between breakpoints and is interpolated; J is computed exactly wherever a speed is asked for.
Source: energy equation of a machine, Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 16.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import root, safe_divide
from linkjax.machine import Scene
from linkjax.motion._extremum import SHARPEN, climb, phi_at, search, settle
from linkjax.motion._grid import Grid, Place, make_grid
from linkjax.motion._panels import legendre_sum
from linkjax.reduction import Reduced, reduce

ERROR_FLOOR = 2e-11


class Shares(NamedTuple):
    """Weights of the parts of the error estimate of δ.

    Each part bounds one error on its own and is far too large, since neighbouring modes cancel. The weights were fitted
    to random designs of the built-in scenes (lengths and masses ± 30 %, 32…160 nodes) so that the sum stays above the
    true error of every one of them; `tests/physics` repeats that on other designs.
    """

    across: float = 0.04  # a panel's own integral
    time: float = 0.06  # duration of the cycle
    average: float = 0.045  # work between the nodes, through the mean speed
    inside: float = 1.6  # work between the nodes, at the extreme itself
    search: float = 2.6  # the search for the extreme


SHARE = Shares()
LEAST = 1e-6  # least kinetic energy, relative to ½ J ω_m², of a regime that counts as running (ω_min / ω_m about 1e-3)


class Primitive(eqx.Module):
    """An integral over the crank angle since the first edge of the grid, panel by panel as Legendre series."""

    grid: Grid
    at_edges: Float[Array, " edges"]
    series: Float[Array, "panels terms"]

    def at(self, place: Place) -> Array:
        """The integral from the first edge to a place of the grid."""
        return self.at_edges[place.panel] + legendre_sum(self.series[place.panel], place.x)


def primitive(grid: Grid, values: Float[Array, "panels n"]) -> Primitive:
    """Integral of a function known at the nodes."""
    scaled = grid.half[:, None] * values
    gained = jnp.cumsum(jnp.sum(grid.rule.w[None] * scaled, axis=1))
    edges = jnp.concatenate([jnp.zeros_like(gained[:1]), gained])
    return Primitive(grid, edges, scaled @ jnp.asarray(grid.rule.primitive.T))


class Steady(eqx.Module):
    """Steady periodic regime. Speeds in rad/s, angles in rad, torque in N m, energies in J, period in s.

    `delta_error` bounds the absolute error of `delta`; `regime_margin` is the least kinetic energy over ½ J̄ ω_m² less
    the least that counts as running: negative means that there is no periodic regime at this mean speed, and
    `lowest_mean_speed` is the lowest that has one.
    """

    work: Primitive
    clock: Primitive
    energy: Array
    drive_torque: Array
    period: Array
    mean_speed: Array
    delta: Array
    delta_error: Array
    speed_max: Array
    speed_min: Array
    angle_of_max: Array
    angle_of_min: Array
    regime_margin: Array
    angle_of_least_work: Array
    lowest_mean_speed: Array
    evaluations: int = eqx.field(static=True)

    @property
    def grid(self) -> Grid:
        """The cycle grid."""
        return self.work.grid

    def at(self, scene: Scene, place: Place) -> tuple[Array, Array]:
        """Crank speed (rad/s) and acceleration (rad/s²) at a place of the grid."""
        here = reduce(scene, place.phi, self.grid.middle[place.panel])
        floor = LEAST * 0.5 * here.inertia * scene.speed**2
        speed = jnp.sqrt(2 * jnp.maximum(self.energy + self.work.at(place), floor) / here.inertia)
        return speed, (here.torque + self.drive_torque - 0.5 * here.slope * speed**2) / here.inertia


def steady(scene: Scene, nodes: int = 96) -> Steady:
    """Steady periodic motion of a scene, with about `nodes` nodes on the cycle grid.

    Never raises: where there is no regime, `regime_margin` is negative and every value finite.
    """
    grid = make_grid(scene, nodes)
    return steady_on(scene, grid, node_values(scene, grid))


def node_values(scene: Scene, grid: Grid) -> Reduced:
    """Reduced inertia, slope and torque at every node, shape (panels, n)."""
    sides = jnp.broadcast_to(grid.middle[:, None], grid.nodes.shape)
    return jax.vmap(jax.vmap(lambda phi, side: reduce(scene, phi, side)))(grid.nodes, sides)


@jax.jit  # traced once, however often a flywheel search calls it
def steady_on(scene: Scene, grid: Grid, here: Reduced) -> Steady:
    """Steady periodic motion from the node values; see `steady`."""
    drive = -jnp.sum(grid.half[:, None] * grid.rule.w[None] * here.torque) / scene.cycle
    flow = Flow(scene, grid, here.inertia, primitive(grid, here.torque + drive), drive)
    energy = flow.energy_for_time_mean()
    clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, here.inertia))
    return conclude(flow, here.torque, energy, clock)


def conclude(flow: Flow, torque: Array, energy: Array, clock: Primitive) -> Steady:
    """Everything that follows from the work over the cycle and the energy constant for the wanted time mean."""
    scene, grid = flow.scene, flow.grid
    ends, rounds = flow.extremes(energy), 1
    if scene.mean == "midrange":  # the extremes depend on the energy and it on them: quadratic convergence
        for _ in range(2):
            energy, rounds = flow.energy_for_midrange(ends), rounds + 1
            ends = flow.extremes(energy)
        energy = flow.energy_for_midrange(ends)
        clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, flow.inertia))
    top, bottom = (e._replace(speed=flow.speed(energy + e.work, e.inertia)) for e in ends)
    delta = (top.speed - bottom.speed) / scene.speed
    error = delta_error(flow, torque, energy, (top, bottom))
    period = flow.period(energy)
    mean = scene.cycle / period if scene.mean == "time" else 0.5 * (top.speed + bottom.speed)
    least, angle = flow.least_work()
    return Steady(
        flow.work, clock, energy, flow.drive, period, mean, delta, jax.lax.stop_gradient(error), top.speed,
        bottom.speed,
        jnp.mod(top.place.phi, scene.cycle), jnp.mod(bottom.place.phi, scene.cycle),
        (energy + least) / flow.scale - LEAST, angle, scene.cycle / flow.period(LEAST * flow.scale - least),
        grid.evaluations + grid.size + rounds * 4 * (SHARPEN + 1),
    )  # fmt: skip


class End(NamedTuple):
    """An extreme of the speed: place, work and reduced inertia there, the speed once the energy is known, and how much
    the search may have missed of (E₀ + W) / J."""

    place: Place
    work: Array
    inertia: Array
    speed: Array
    left: Array


class Flow:
    """Node values of one cycle and what follows from them once the energy constant E₀ is chosen."""

    def __init__(self, scene: Scene, grid: Grid, inertia: Array, work: Primitive, drive: Array):
        r = grid.rule
        self.scene, self.grid, self.work, self.inertia, self.drive = scene, grid, work, inertia, drive
        self.weights = grid.half[:, None] * r.w[None]
        base = work.at_edges[:-1, None]
        self.at_nodes = base + work.series @ jnp.asarray(r.at_nodes.T)
        self.fine = base + work.series @ jnp.asarray(r.at_fine.T)
        self.inertia_fine = inertia @ jnp.asarray(r.to_fine.T)
        self.scale = 0.5 * scene.speed**2 * jnp.sum(self.weights * inertia) / scene.cycle

    def running(self, energy: Array) -> Array:
        """Kinetic energy kept positive: unchanged above `LEAST`, a smooth positive tail below."""
        floor = LEAST * self.scale
        low = energy <= floor
        return jnp.where(low, floor / (2 - jnp.where(low, energy, floor) / floor), energy)

    def speed(self, energy: Array, inertia: Array) -> Array:
        """Crank speed (rad/s) from the kinetic energy."""
        return jnp.sqrt(2 * self.running(energy) / inertia)

    def period(self, energy: Array) -> Array:
        """Duration of the cycle (s)."""
        return jnp.sum(self.weights / self.speed(energy + self.at_nodes, self.inertia))

    def energy_for_time_mean(self) -> Array:
        """E₀ for which the time mean of the speed is the wanted one; Newton on 1/period², which is nearly linear."""
        wanted = self.scene.cycle / self.scene.speed
        share = self.weights / self.scene.cycle
        guess = (0.5 * self.scene.speed**2 - jnp.sum(share * self.at_nodes / self.inertia)) / jnp.sum(
            share / self.inertia
        )

        def solve(_, start):
            def step(state):
                count, energy, _ = state
                kinetic = energy + self.at_nodes
                running = self.running(kinetic)
                slowness = self.weights * jnp.sqrt(0.5 * self.inertia / running)
                steep = jnp.where(kinetic > LEAST * self.scale, 1.0, (running / (LEAST * self.scale)) ** 2)
                period, slope = jnp.sum(slowness), -0.5 * jnp.sum(slowness * steep / running)
                move = safe_divide(-0.5 * period * ((period / wanted) ** 2 - 1), slope)
                return count + 1, energy + move, jnp.abs(move) > 4e-16 * jnp.abs(self.scale + energy)

            return jax.lax.while_loop(lambda s: s[2] & (s[0] < 40), step, (0, start, jnp.asarray(True)))[1]

        return root(lambda energy: self.period(energy) / wanted - 1, jax.lax.stop_gradient(guess), solve)

    def energy_for_midrange(self, ends: tuple[End, End]) -> Array:
        """E₀ for which the mean of the largest and smallest speed is the wanted one."""
        (a, j), (b, k) = ((end.work, end.inertia) for end in ends)

        def excess(energy):
            return 0.5 * (self.speed(energy + a, j) + self.speed(energy + b, k)) / self.scene.speed - 1

        def solve(_, start):
            def step(state):
                count, energy, _ = state
                value, slope = jax.jvp(excess, (energy,), (jnp.ones_like(energy),))
                move = -0.5 * ((1 + value) - 1 / (1 + value)) / slope  # Newton on the square, nearly linear
                return count + 1, energy + move, jnp.abs(move) > 4e-16 * jnp.abs(self.scale + energy)

            return jax.lax.while_loop(lambda s: s[2] & (s[0] < 40), step, (0, start, jnp.asarray(True)))[1]

        return root(excess, jax.lax.stop_gradient(self.scale - 0.5 * (a + b)), solve)

    def extremes(self, energy: Array) -> tuple[End, End]:
        """Largest and smallest speed over the continuous cycle: where (E₀ + W) / J is stationary."""
        height = (energy + self.fine) / self.inertia_fine

        fine = jnp.asarray(self.grid.rule.fine)

        def end(sign, summit):
            panel, side = summit.panel, self.grid.middle[summit.panel]

            def slope(x):
                place = Place(panel, x, phi_at(self.grid, panel, x))
                here = reduce(self.scene, place.phi, side)
                gain = here.torque + self.drive - (energy + self.work.at(place)) * here.slope / here.inertia
                return sign * self.grid.half[panel] * gain / here.inertia

            x, left = climb(slope, summit, SHARPEN)
            place = settle(self.grid, panel, x)
            inertia = reduce(self.scene, place.phi, side).inertia
            work = self.work.at(place)
            return End(place, work, inertia, (energy + work) / inertia, left)

        def best(sign):
            """The better of the two best summits: which is the higher only the exact inertia can tell."""
            first = search(fine, sign * height)
            both = jax.tree.map(lambda a, b: jnp.stack([a, b]), first, search(fine, first.rest))
            found = jax.vmap(lambda summit: end(sign, summit))(both)
            second = jax.lax.stop_gradient(sign * (found.speed[1] - found.speed[0]) > 0)
            return jax.tree.map(lambda leaf: jnp.where(second, leaf[1], leaf[0]), found)

        both = jax.vmap(best)(jnp.asarray([1.0, -1.0], dtype=height.dtype))
        return End(*_at(both, 0)), End(*_at(both, 1))

    def least_work(self) -> tuple[Array, Array]:
        """Least W on nodes and search grid (J), and its angle (rad)."""
        at = jnp.argmin(self.fine)
        panel, i = at // self.fine.shape[1], at % self.fine.shape[1]
        angle = phi_at(self.grid, panel, jnp.asarray(self.grid.rule.fine)[i])
        return jnp.minimum(jnp.min(self.fine), jnp.min(self.at_nodes)), jnp.mod(angle, self.scene.cycle)


def _at(tree, i: int):
    return jax.tree.map(lambda leaf: leaf[i], tree)


def delta_error(flow: Flow, torque: Array, energy: Array, ends: tuple[End, End]) -> Array:
    """Bound of the absolute error of δ, from the decay of the Legendre series of work, torque and slowness."""
    grid, scene = flow.grid, flow.scene
    r = grid.rule
    slowness = 1 / flow.speed(energy + flow.at_nodes, flow.inertia)
    spectrum = jnp.asarray(r.spectrum.T)
    torque_tail, torque_ratio = _tail(torque @ spectrum)
    slow_tail, slow_ratio = _tail(slowness @ spectrum)
    work_tail, work_ratio = _tail(flow.work.series)
    inside = work_tail * work_ratio / (1 - work_ratio)
    across = jnp.sum(2 * grid.half * torque_tail * torque_ratio**grid.n)
    lost_time = jnp.sum(2 * grid.half * slow_tail * slow_ratio**grid.n)
    gain = 0.5 * jnp.sum(flow.weights * slowness / flow.running(energy + flow.at_nodes))
    average = jnp.sum(2 * grid.half * inside) / scene.cycle
    everywhere = SHARE.across * across + SHARE.time * lost_time / gain + SHARE.average * average
    parts = [
        (everywhere + SHARE.inside * inside[e.place.panel]) / (e.inertia * e.speed) + SHARE.search * e.left / e.speed
        for e in ends
    ]
    return sum(parts, jnp.zeros(())) / scene.speed + ERROR_FLOOR


def _tail(series: Float[Array, "panels terms"]) -> tuple[Array, Array]:
    """Size of the last terms of each panel's series, and their decay from one degree to the next."""
    last = jnp.max(jnp.abs(series[:, -2:]), axis=1)
    before = jnp.max(jnp.abs(series[:, -4:-2]), axis=1)
    return last, jnp.clip(jnp.sqrt(safe_divide(last, before, 0.0)), 0.05, 0.95)
