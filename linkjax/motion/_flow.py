"""Node values of one cycle, and the motion that follows from them for an energy constant E₀.

½ J ω² = E₀ + W(φ). The work W is the integral of the interpolated torque. (E₀ + W) / J is known with its slope at every
node; its extremes are found between the nodes, then refined by evaluating the mechanism there.

The two best of all cubic pieces are refined by two evaluations of the mechanism each. Compared with the extremes of the
Legendre interpolants of W and J: same accuracy, a third of the compiled program, twice as fast.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._numerics import highest, largest, once, root, safe_divide, safe_sqrt, smallest, taken
from linkjax._tree import node
from linkjax.kinematics import Pose
from linkjax.machine import Scene
from linkjax.motion._by_speed import Driven, first_of, moving_at, near_by
from linkjax.motion._extremum import Pieces, best_piece, doubt, newton, pieces
from linkjax.motion._grid import Grid, Place
from linkjax.motion._panels import series_sum
from linkjax.reduction import Moving, Reduced

LEAST = 1e-6  # least kinetic energy, relative to ½ J ω_m², of a steady-state motion (ω_min / ω_m about 1e-3)
NO_INERTIA = 1e-9  # a reduced inertia smaller than this, relative to its mean, counts as zero
ENOUGH = 1e-9  # relative: after a Newton step as small as this the error is its square


@node
class Primitive:
    """An integral over the crank angle since the first edge of the grid, panel by panel as Chebyshev series."""

    grid: Grid
    at_edges: Float[Array, " edges"]
    series: Float[Array, "panels terms"]

    def at(self, place: Place) -> Array:
        """The integral from the first edge to places of the grid."""
        return taken(self.at_edges, place.panel) + series_sum(taken(self.series, place.panel), place.x)

    def extremes(self) -> tuple[Array, Array]:
        """Largest and smallest value over the continuous cycle, and their crank angles (rad); each of shape (2,)."""
        rule, sign = self.grid.rule, jnp.asarray([1.0, -1.0], self.series.dtype)
        # no derivatives of the search: a maximum of values that XLA computes twice, with other rounding, has none
        edges, series = jax.lax.stop_gradient((self.at_edges, self.series))
        value = edges[:-1, None] + series @ jnp.asarray(rule.at_points.T)
        found = pieces(rule, value, series @ jnp.asarray(rule.slope_at_points.T))
        panel, x, bend = jax.vmap(lambda height: best_piece(found, height))(jnp.stack([found.high, -found.low]))
        rows = taken(self.series, panel)
        _, slope = jax.jvp(lambda x: series_sum(rows, x), (x,), (jnp.ones_like(x),))
        place = self.grid.at(panel, x + newton(x, sign * slope, bend))
        return self.at(place), place.phi


def primitive(grid: Grid, values: Float[Array, "panels n"]) -> Primitive:
    """Integral of a function known at the nodes."""
    scaled = grid.half[:, None] * values
    gained = jnp.sum(grid.rule.w[None] * scaled, axis=1)
    edges = jnp.asarray(np.tri(gained.size + 1, gained.size, -1)) @ gained
    return Primitive(grid, edges, scaled @ jnp.asarray(grid.rule.primitive.T))


@node
class Duty:
    """What is asked of the crank: mean speed (rad/s), length of the cycle (rad), which mean it is, and whether a motion
    law prescribes the motion."""

    speed: Array
    cycle: float = eqx.field(static=True)
    mean: str = eqx.field(static=True)
    prescribed: bool = eqx.field(static=True)


class Spots(NamedTuple):
    """Guesses of four extremes of the speed, two summits and two dips, and of the least reduced inertia: panel,
    coordinate, and bend (magnitude of the second derivative with respect to x); each of shape (5,). With the cubic
    pieces of (E₀ + W) / J, and the error of each."""

    panel: Array
    x: Array
    bend: Array
    pieces: Pieces
    doubt: Array


SIGNS = np.asarray([1.0, 1.0, -1.0, -1.0, -1.0])  # a maximum or a minimum
# of the first step: a longer second one is not taken; the inertia beside a change point is no parabola
SHORTER = 1.0, 1.0, 1.0, 1.0, 0.1


class Ends(NamedTuple):
    """Two extremes of the speed, the largest and the smallest (leaves of shape (2,)): place, (E₀ + W) / J at the
    extreme itself, reduced inertia at the place and its slope, the error of (E₀ + W) / J from the search, and the angle
    of the next best summit, which was evaluated too."""

    place: Place
    height: Array
    inertia: Array
    slope: Array
    left: Array
    other: Array


@node
class Flow:
    """Node values of one cycle: reduced inertia with slope and torque (`here`), work, balancing drive torque; `added`
    is the inertia of a flywheel and of a rotor (kg m²) that the reduced model of the machine does not have. Where the
    motion is `driven` by torques that depend on the speed, `here` contains all torques, and `drive` is zero."""

    duty: Duty
    grid: Grid
    here: Reduced
    work: Primitive
    drive: Array
    inertia: Array
    weights: Array
    at_nodes: Array
    scale: Array
    mean: Array
    floor: Array
    added: Array
    driven: Driven | None

    @staticmethod
    def of(
        duty: Duty, grid: Grid, here: Reduced, work: Primitive, drive: Array, added: Array | float = 0.0,
        driven: Driven | None = None,
    ) -> Flow:  # fmt: skip
        """The flow with what follows from its parts."""
        r, weights = grid.rule, grid.half[:, None] * grid.rule.w[None]
        mean = jnp.sum(weights * here.inertia) / duty.cycle
        floor = inertia_floor(mean)
        inertia = jnp.maximum(here.inertia, floor)
        at_nodes = work.at_edges[:-1, None] + work.series @ jnp.asarray(r.at_nodes.T)
        scale = 0.5 * duty.speed**2 * jnp.sum(weights * inertia) / duty.cycle
        here = here._replace(inertia=inertia)
        return Flow(
            duty, grid, here, work, drive, inertia, weights, at_nodes, scale, mean, floor, jnp.asarray(added, float),
            driven,
        )  # fmt: skip

    def running(self, energy: Array) -> Array:
        """Kinetic energy, kept positive: unchanged above `LEAST`, continued by a smooth positive function below."""
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
        """E₀ that gives the wanted time mean of the speed, by Newton's method between bounds."""
        wanted = self.duty.cycle / self.duty.speed
        room = 0.5 * self.duty.speed**2 * self.inertia - self.at_nodes  # E₀ with the wanted speed at each node
        low, high = smallest(room), largest(room)
        lowest = LEAST * self.scale - smallest(self.at_nodes)  # below, the kinetic energy falls to zero somewhere
        guess = jnp.sum(self.weights * room / self.inertia) / jnp.sum(self.weights / self.inertia)

        def solve(_, start):
            def step(state):
                count, energy, low, high, _ = state
                kinetic = energy + self.at_nodes
                running = self.running(kinetic)
                slowness = self.weights * jnp.sqrt(0.5 * self.inertia / running)
                steep = jnp.where(kinetic > LEAST * self.scale, 1.0, (running / (LEAST * self.scale)) ** 2)
                period, slope = jnp.sum(slowness), -0.5 * jnp.sum(slowness * steep / running)
                late = period / wanted
                low, high = jnp.where(late > 1, energy, low), jnp.where(late < 1, energy, high)
                # nearly linear in the energy: 1 / period² if the kinetic energy stays positive, else period²
                move = -0.5 * period * jnp.where(energy > lowest, late**2 - 1, 1 - late**-2) / slope
                inside = (energy + move >= low) & (energy + move <= high)
                move = jnp.where(inside, move, 0.5 * (low + high) - energy)
                return count + 1, energy + move, low, high, jnp.abs(move) > ENOUGH * (self.scale + jnp.abs(energy))

            state = (0, jnp.clip(start, low, high), low, high, jnp.asarray(True))
            return jax.lax.while_loop(lambda s: s[4] & (s[0] < 60), step, state)[1]

        return root(lambda energy: self.period(energy) / wanted - 1, jax.lax.stop_gradient(guess), solve)

    def energy_for_midrange(self, energy: Array, ends: Ends) -> Array:
        """E₀ that gives the wanted mean of the largest and smallest speed, with the extremes at the places that they
        had at another `energy`."""
        work, inertia = ends.height * ends.inertia - energy, ends.inertia

        def excess(energy):
            return 0.5 * jnp.sum(self.speed(energy + work, inertia)) / self.duty.speed - 1

        def solve(_, start):
            def step(state):
                count, energy, _ = state
                value, slope = jax.jvp(excess, (energy,), (jnp.ones_like(energy),))
                move = -0.5 * ((1 + value) - 1 / (1 + value)) / slope  # Newton on the square, nearly linear
                return count + 1, energy + move, jnp.abs(move) > ENOUGH * (self.scale + jnp.abs(energy))

            return jax.lax.while_loop(lambda s: s[2] & (s[0] < 40), step, (0, start, jnp.asarray(True)))[1]

        return root(excess, jax.lax.stop_gradient(self.scale - 0.5 * jnp.sum(work)), solve)

    def profile(self, energy: Array) -> tuple[Array, Array]:
        """(E₀ + W) / J and its slope with respect to x at the low end, the nodes and the high end of every panel."""
        half, values = self.grid.half[:, None], self.inertia
        slopes = half * self.here.slope
        inertia, slope = self._inertia_at_ends()

        def height_and_slope(work, torque, inertia, slope):
            height = once((energy + work) / inertia)
            return height, once((half * torque - height * slope) / inertia)

        nodes = height_and_slope(self.at_nodes, self.here.torque + self.drive, values, slopes)
        ends = height_and_slope(*self.at_ends(), inertia, slope)
        height, slope = (_between(*part) for part in zip(ends, nodes, strict=True))
        return height, slope

    def _inertia_at_ends(self) -> tuple[Array, Array]:
        """Reduced inertia and its slope with respect to x at the two ends of every panel."""
        r, slopes = self.grid.rule, self.grid.half[:, None] * self.here.slope
        inertia, slope = (
            self.inertia @ jnp.asarray(m.T) + slopes @ jnp.asarray(k.T) for m, k in (r.hermite_ends, r.hermite_slopes)
        )
        return jnp.maximum(inertia, self.floor), slope

    def at_ends(self) -> tuple[Array, Array]:
        """Work W (J) and its slope Q + T (N m) at the two ends of every panel."""
        edges = self.work.at_edges
        torque = self.here.torque @ jnp.asarray(self.grid.rule.ends.T) + self.drive
        return jnp.stack([edges[:-1], edges[1:]], axis=1), torque

    def reduced(self, dynamics: tuple, panel: Array) -> Reduced:
        """The reduced model at places in these panels."""
        here = self.grid.reduced(dynamics, panel)
        return here._replace(inertia=here.inertia + self.added)

    def moving(self, pose: Pose | None, place: Place) -> Moving | None:
        """What loads that depend on the speed need at places, of which `pose` may have more."""
        if pose is None or self.driven is None:
            return None
        here = jax.tree.map(lambda leaf: leaf[: place.phi.shape[0]], pose)
        moving = moving_at(self.driven.torques, self.grid, here, place.phi, place.panel)
        return near_by(moving, self.grid, self.driven.near, place.panel, place.x)

    def speeds(self, ends: Ends) -> Array:
        """Largest and smallest speed (rad/s)."""
        return self.speed(ends.height * ends.inertia, ends.inertia)

    def least_energy(self) -> Array:
        """E₀ (J) with which the crank only just rotates fully."""
        return LEAST * self.scale - self.work.extremes()[0][1]

    def spots(self, energy: Array) -> Spots:
        """Guesses of the extremes, from the cubic pieces of (E₀ + W) / J and of the reduced inertia."""
        rule, half = self.grid.rule, self.grid.half[:, None]
        ends, slopes = self._inertia_at_ends()
        light = _between(ends, self.inertia), _between(slopes, half * self.here.slope)
        both = [jnp.stack(pair) for pair in zip(self.profile(energy), light, strict=True)]
        found = jax.vmap(lambda value, slope: pieces(rule, value, slope))(*both)
        speed, light = (jax.tree.map(lambda leaf, i=i: leaf[i], found) for i in (0, 1))
        first = jnp.stack([speed.high, -speed.low])
        second = jax.vmap(_without_best)(first)
        heights = jnp.concatenate([first[:1], second[:1], first[1:], second[1:]])
        best, least = jax.vmap(lambda height: best_piece(speed, height))(heights), best_piece(light, -light.low)
        panel, x, bend = (jnp.concatenate([four, one[None]]) for four, one in zip(best, least, strict=True))
        return Spots(panel, x, bend, speed, doubt(rule, *(part[0] for part in both)))

    def tilt(
        self, panel: Array, x: Array, energy: Array, here: Reduced, moving: Moving | None
    ) -> tuple[Array, Array, Array]:
        """At places: (E₀ + W) / J, its slope with respect to x, and the reduced inertia, at least `floor`."""
        place, inertia = self.grid.at(panel, x), jnp.maximum(here.inertia, self.floor)
        height = (energy + self.work.at(place)) / inertia
        rise = self.rise(here._replace(inertia=inertia), height, moving)
        return height, taken(self.grid.half, panel) * rise, inertia

    def ends(
        self,
        bend: Array,
        move: Array,
        tilt: Array,
        place: Place,
        energy: Array,
        here: Reduced,
        moving: Moving | None,
    ) -> tuple[Ends, tuple[Array, Array]]:
        """The extremes, and the least reduced inertia relative to its mean with its angle (rad). `here` belongs to the
        places, which a step `move` of Newton's method reached from where the slope was `tilt`.

        A second step uses the parabola alone, and derivatives pass through it. The first derivative is unaffected by
        the step, since an extreme value does not depend on its position to first order (envelope theorem); the second
        derivative is correct.
        """
        at, own = (jax.tree.map(lambda leaf: leaf[:4], part) for part in (place, here))
        height, slope, inertia = self.tilt(at.panel, at.x, energy, own, first_of(moving, 4))
        half = taken(self.grid.half, place.panel)
        slope = jnp.concatenate([slope, (half * here.slope)[4:]])
        sign, most = jnp.asarray(SIGNS, tilt.dtype), jax.lax.stop_gradient(jnp.abs(move))
        secant = sign * safe_divide(tilt - jax.lax.stop_gradient(slope), move)
        bend = jnp.where((secant > 0.3 * bend) & (secant < 3 * bend), secant, bend)
        last = jnp.clip(newton(place.x, sign * slope, bend), -most, most)
        last = jnp.where(jnp.abs(last) <= np.asarray(SHORTER) * most, last, 0.0)
        gain, moved = slope * last - 0.5 * sign * bend * last**2, place.phi + half * last
        reached = at._replace(x=at.x + last[:4], phi=moved[:4])
        left = jax.lax.stop_gradient(jnp.abs(gain[:4]))
        found = Ends(reached, height + gain[:4], inertia, own.slope, left, at.phi)
        tops = jax.lax.stop_gradient(sign[:4] * found.height)  # compared on the mechanism itself
        second, first = jnp.where(tops[1::2] > tops[::2], 1, 0), np.asarray([0, 2])
        chosen = jax.tree.map(lambda leaf: taken(leaf, first + second), found)
        light = self._lightest(moved[4], here.inertia[4] + gain[4])
        return chosen._replace(other=taken(at.phi, first + 1 - second)), light

    def _lightest(self, phi: Array, found: Array) -> tuple[Array, Array]:
        """Least reduced inertia relative to its mean, and its angle (rad)."""
        first = jnp.argmin(jax.lax.stop_gradient(self.inertia))  # a minimum too sharp to show between nodes is at one
        at_node = taken(self.inertia.ravel(), first)
        phi = jnp.where(at_node < found, taken(self.grid.nodes.ravel(), first), phi)
        least = jnp.minimum(found, at_node) * self.duty.speed**2 / (2 * self.scale)
        return jnp.where(self.mean > 0, least, jnp.minimum(least, -1.0)), phi

    def rise(self, here: Reduced, height: Array, moving: Moving | None) -> Array:
        """Derivative of `height` = (E₀ + W) / J with respect to the crank angle."""
        torque = here.torque + self.drive
        if self.driven is not None:
            speed = safe_sqrt(2 * height, 1e-9 * self.duty.speed)
            bare = here._replace(inertia=here.inertia - self.driven.torques.rotor)
            torque = self.driven.rise(bare, moving, speed)
        return (torque - height * here.slope) / here.inertia


class Begun(NamedTuple):
    """The work over the cycle, the energy constant for the wanted time mean, the time, and guesses of the extremes with
    their places."""

    flow: Flow
    energy: Array
    clock: Primitive
    spots: Spots
    place: Place


def spotted(flow: Flow, energy: Array) -> tuple[Spots, Place]:
    """Guesses of the extremes, with their places."""
    spots = jax.lax.stop_gradient(flow).spots(jax.lax.stop_gradient(energy))
    return spots, flow.grid.at(spots.panel, spots.x)


def duty_of(scene: Scene) -> Duty:
    """What a scene asks of its crank."""
    return Duty(scene.speed, scene.cycle, scene.mean, scene.mechanism.prescribed)


def inertia_floor(mean: Array) -> Array:
    """The least reduced inertia (kg m²) used as a divisor; 1 for a machine without inertia."""
    return jax.lax.stop_gradient(jnp.where(mean > 0, NO_INERTIA * mean, 1.0))


def _between(ends: Array, nodes: Array) -> Array:
    """Values at the low end, the nodes and the high end of every panel."""
    return jnp.concatenate([ends[:, :1], nodes, ends[:, 1:]], axis=1)


def _without_best(height: Array) -> Array:
    """Heights of the pieces without the highest summit and its neighbours; unchanged if there is no other summit."""
    flat, number = height.ravel(), jnp.arange(height.size)
    first = jnp.max(jnp.where(highest(flat), number, 0))
    apart = jnp.abs(number - first)
    summit = (flat >= jnp.roll(flat, 1)) & (flat >= jnp.roll(flat, -1)) & (apart > 1) & (apart < flat.size - 1)
    rest = jnp.where(summit, flat, -jnp.inf)
    return jnp.where(jnp.any(summit), rest, flat).reshape(height.shape)
