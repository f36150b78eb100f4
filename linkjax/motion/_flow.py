"""Node values of one cycle, and the motion that follows from them for an energy constant E₀.

½ J ω² = E₀ + W(φ). The work W is the integral of the interpolated torque. (E₀ + W) / J is known with its slope at every
node; its extremes are found between the nodes, then refined by evaluating the mechanism there.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._numerics import highest, largest, once, root, safe_divide, smallest
from linkjax.machine import Scene
from linkjax.motion._extremum import Pieces, best_piece, newton, phi_at, pieces
from linkjax.motion._grid import Grid, Place
from linkjax.motion._panels import legendre_sum
from linkjax.reduction import Reduced, governing, reduced_model

LEAST = 1e-6  # least kinetic energy, relative to ½ J ω_m², of a steady-state motion (ω_min / ω_m about 1e-3)
NO_INERTIA = 1e-9  # a reduced inertia smaller than this, relative to its mean, counts as zero
ENOUGH = 1e-9  # relative: after a Newton step as small as this the error is its square


class Primitive(eqx.Module):
    """An integral over the crank angle since the first edge of the grid, panel by panel as Legendre series."""

    grid: Grid
    at_edges: Float[Array, " edges"]
    series: Float[Array, "panels terms"]

    def at(self, place: Place) -> Array:
        """The integral from the first edge to a place of the grid."""
        return self.at_edges[place.panel] + legendre_sum(self.series[place.panel], place.x)

    def extreme(self, sign: int) -> tuple[Array, Array]:
        """Largest (`sign` = 1) or smallest (-1) value over the continuous cycle, and its crank angle (rad)."""
        rule = self.grid.rule
        value = self.at_edges[:-1, None] + self.series @ jnp.asarray(rule.at_points.T)
        found = pieces(rule, value, self.series @ jnp.asarray(rule.slope_at_points.T))
        panel, x, bend = best_piece(found, found.high if sign > 0 else -found.low)
        row = self.series[panel]
        _, slope = jax.jvp(lambda x: legendre_sum(row, x), (x,), (jnp.ones_like(x),))
        x = x + newton(x, sign * slope, bend)
        place = Place(panel, x, phi_at(self.grid, panel, x))
        return self.at(place), place.phi


def primitive(grid: Grid, values: Float[Array, "panels n"]) -> Primitive:
    """Integral of a function known at the nodes."""
    scaled = grid.half[:, None] * values
    gained = jnp.sum(grid.rule.w[None] * scaled, axis=1)
    edges = jnp.asarray(np.tri(gained.size + 1, gained.size, -1)) @ gained
    return Primitive(grid, edges, scaled @ jnp.asarray(grid.rule.primitive.T))


class End(NamedTuple):
    """An extreme of the speed: its place, (E₀ + W) / J at the extreme itself, reduced inertia at the place, slopes
    there (of (E₀ + W) / J with respect to x, of J with respect to the angle), the error of (E₀ + W) / J from the
    search, and the angle of the next best summit, which was evaluated too."""

    place: Place
    height: Array
    inertia: Array
    tilt: Array
    slope: Array
    left: Array
    other: Array


class Flow(eqx.Module):
    """Node values of one cycle: reduced inertia with slope and torque (`here`), work, balancing drive torque."""

    scene: Scene
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

    def __init__(self, scene: Scene, grid: Grid, here: Reduced, work: Primitive, drive: Array):
        r = grid.rule
        self.scene, self.grid, self.work, self.drive = scene, grid, work, drive
        self.weights = grid.half[:, None] * r.w[None]
        self.mean = jnp.sum(self.weights * here.inertia) / scene.cycle
        self.floor = inertia_floor(self.mean)
        self.inertia = jnp.maximum(here.inertia, self.floor)
        self.here = here._replace(inertia=self.inertia)
        self.at_nodes = work.at_edges[:-1, None] + work.series @ jnp.asarray(r.at_nodes.T)
        self.scale = 0.5 * scene.speed**2 * jnp.sum(self.weights * self.inertia) / scene.cycle

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
        wanted = self.scene.cycle / self.scene.speed
        room = 0.5 * self.scene.speed**2 * self.inertia - self.at_nodes  # E₀ with the wanted speed at each node
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

    def energy_for_midrange(self, energy: Array, ends: tuple[End, End]) -> Array:
        """E₀ that gives the wanted mean of the largest and smallest speed, with the extremes at the places that they
        had at another `energy`."""
        (a, j), (b, k) = ((end.height * end.inertia - energy, end.inertia) for end in ends)

        def excess(energy):
            return 0.5 * (self.speed(energy + a, j) + self.speed(energy + b, k)) / self.scene.speed - 1

        def solve(_, start):
            def step(state):
                count, energy, _ = state
                value, slope = jax.jvp(excess, (energy,), (jnp.ones_like(energy),))
                move = -0.5 * ((1 + value) - 1 / (1 + value)) / slope  # Newton on the square, nearly linear
                return count + 1, energy + move, jnp.abs(move) > ENOUGH * (self.scale + jnp.abs(energy))

            return jax.lax.while_loop(lambda s: s[2] & (s[0] < 40), step, (0, start, jnp.asarray(True)))[1]

        return root(excess, jax.lax.stop_gradient(self.scale - 0.5 * (a + b)), solve)

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

    def min_inertia_ratio(self) -> tuple[Array, Array]:
        """Least reduced inertia over the continuous cycle, relative to its mean, and its angle (rad)."""
        ends, slopes, half = *self._inertia_at_ends(), self.grid.half[:, None]
        value, slope = _between(ends, self.inertia), _between(slopes, half * self.here.slope)
        found = pieces(self.grid.rule, value, slope)
        panel, x, bend = best_piece(found, -found.low)

        def at(x):
            phi = phi_at(self.grid, panel, x)
            return phi, governing(self.scene, reduced_model(self.scene, phi, self.grid.middle[panel]))

        phi, here = at(x + newton(x, -self.grid.half[panel] * at(x)[1].slope, bend))
        first = jnp.argmin(jax.lax.stop_gradient(self.inertia))  # a minimum too sharp to show between nodes is at one
        phi = jnp.where(self.inertia.ravel()[first] < here.inertia, self.grid.nodes.ravel()[first], phi)
        least = jnp.minimum(here.inertia, smallest(self.inertia)) * self.scene.speed**2 / (2 * self.scale)
        return jnp.where(self.mean > 0, least, jnp.minimum(least, -1.0)), phi

    def at_ends(self) -> tuple[Array, Array]:
        """Work W (J) and its slope Q + T (N m) at the two ends of every panel."""
        edges = self.work.at_edges
        torque = self.here.torque @ jnp.asarray(self.grid.rule.ends.T) + self.drive
        return jnp.stack([edges[:-1], edges[1:]], axis=1), torque

    def extremes(self, energy: Array) -> tuple[End, End]:
        """Largest and smallest speed over the continuous cycle, where (E₀ + W) / J is stationary."""
        found = jax.lax.stop_gradient(pieces(self.grid.rule, *self.profile(energy)))
        signs = jnp.asarray([1.0, 1.0, -1.0, -1.0], dtype=found.x.dtype)
        spots = [spot for height in (found.high, -found.low) for spot in _two_best(found, height)]
        panel, x, bend = (jnp.stack(part) for part in zip(*spots, strict=True))
        ends = jax.vmap(self._end, (0, 0, 0, 0, None))(signs, panel, x, bend, energy)
        tops = jax.lax.stop_gradient(signs * ends.height)  # compared on the mechanism itself

        def best(i):
            second = tops[i + 1] > tops[i]
            end = jax.tree.map(lambda leaf: jnp.where(second, leaf[i + 1], leaf[i]), ends)
            return end._replace(other=jnp.where(second, ends.place.phi[i], ends.place.phi[i + 1]))

        return best(0), best(2)

    def _end(self, sign: Array, panel: Array, x: Array, bend: Array, energy: Array) -> End:
        """One extreme, from a first guess and its bend: Newton's method on the mechanism itself, twice.

        The second step uses the parabola alone, and derivatives pass through it. The first derivative is unaffected by
        the step, since an extreme value does not depend on its position to first order (envelope theorem); the second
        derivative is correct.
        """
        fixed = jax.lax.stop_gradient(self)
        tilt = fixed._at(panel, x, jax.lax.stop_gradient(energy))[-1]
        move = newton(x, sign * tilt, bend)
        second = self._at(panel, x + move, energy)
        secant = sign * safe_divide(tilt - jax.lax.stop_gradient(second[-1]), move)
        bend = jnp.where((secant > 0.3 * bend) & (secant < 3 * bend), secant, bend)
        place, height, here, tilt = second
        move = jnp.clip(newton(place.x, sign * tilt, bend), -jnp.abs(move), jnp.abs(move))
        gain = tilt * move - 0.5 * sign * bend * move**2
        place = place._replace(x=place.x + move, phi=place.phi + self.grid.half[panel] * move)
        return End(
            place, height + gain, here.inertia, tilt, here.slope, jax.lax.stop_gradient(jnp.abs(gain)), place.phi
        )

    def _at(self, panel: Array, x: Array, energy: Array) -> tuple[Place, Array, Reduced, Array]:
        """Place, (E₀ + W) / J, the reduced mechanism, and the slope of (E₀ + W) / J with respect to x."""
        place = Place(panel, x, phi_at(self.grid, panel, x))
        here = governing(self.scene, reduced_model(self.scene, place.phi, self.grid.middle[panel]))
        here = here._replace(inertia=jnp.maximum(here.inertia, self.floor))
        height = (energy + self.work.at(place)) / here.inertia
        return place, height, here, self.grid.half[panel] * self.rise(here, height)

    def rise(self, here: Reduced, height: Array) -> Array:
        """Derivative of `height` = (E₀ + W) / J with respect to the crank angle."""
        return (here.torque + self.drive - height * here.slope) / here.inertia


def inertia_floor(mean: Array) -> Array:
    """The least reduced inertia (kg m²) used as a divisor; 1 for a machine without inertia."""
    return jax.lax.stop_gradient(jnp.where(mean > 0, NO_INERTIA * mean, 1.0))


def _between(ends: Array, nodes: Array) -> Array:
    """Values at the low end, the nodes and the high end of every panel."""
    return jnp.concatenate([ends[:, :1], nodes, ends[:, 1:]], axis=1)


def _two_best(found: Pieces, height: Array) -> list[tuple[Array, Array, Array]]:
    """The two highest summits: panel, coordinate and bend of each (the same one twice if there is only one)."""
    flat, number = height.ravel(), jnp.arange(height.size)
    first = jnp.max(jnp.where(highest(flat), number, 0))
    apart = jnp.abs(number - first)
    summit = (flat >= jnp.roll(flat, 1)) & (flat >= jnp.roll(flat, -1)) & (apart > 1) & (apart < flat.size - 1)
    rest = jnp.where(summit, flat, -jnp.inf)
    rest = jnp.where(jnp.any(summit), rest, flat).reshape(height.shape)
    return [best_piece(found, height), best_piece(found, rest)]
