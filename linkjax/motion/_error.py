"""How wrong δ can be: from what the interpolants miss at the panels' edges, and how fast their series decay.

A function interpolated at the n Gauss nodes of a panel is wrong by P_n(x) h(x), and at an edge P_n is ±1: one more
evaluation there shows h. Integrals are wrong by the part of h of degree n, which is smaller by the decay of the series
to the power n (about ρ^n (2j + 1) for a pole); the work inside a panel is wrong by h times the integral of P_n.
Source: Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, ch. 11 and 19; the safety factors were
checked on random designs, see `tests/physics/test_delta_error.py`.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from linkjax._numerics import safe_divide
from linkjax.kinematics import pose
from linkjax.loads import Instant
from linkjax.motion._flow import End, Flow
from linkjax.reduction import Reduced, reduce_pose

FLOOR = 2e-11


def delta_error(flow: Flow, energy: Array, extremes: tuple[End, End]) -> Array:
    """Bound of the absolute error of δ; evaluates the mechanism at the edges of the panels."""
    grid, scene, n = flow.grid, flow.scene, flow.grid.n
    spectrum = jnp.asarray(grid.rule.spectrum.T)
    slowness = 1 / flow.speed(energy + flow.at_nodes, flow.inertia)
    weight = slowness / flow.running(energy + flow.at_nodes)  # what the period loses per energy, doubled
    torque_series, slow_series, weight_series = flow.here.torque @ spectrum, slowness @ spectrum, weight @ spectrum

    inertia, after, before = _at_edges(flow)
    work = flow.work.at_edges[:-1]
    at_edges = 1 / flow.speed(energy + work, inertia)
    torque = _missed(torque_series, after, jnp.roll(before, -1))
    slow = _missed(slow_series, at_edges, jnp.roll(at_edges, -1))
    slopes = grid.half[:, None] * flow.here.slope
    ends = sum(v @ jnp.asarray(m.T) for v, m in zip((flow.inertia, slopes), grid.rule.hermite_ends, strict=True))
    stiff = jnp.max(jnp.abs(ends - jnp.stack([inertia, jnp.roll(inertia, -1)], axis=1)), axis=1) / inertia
    found = flow.pieces(energy)
    torque_decay, slow_decay = _decay(torque_series), _decay(slow_series)

    gain = 0.5 * jnp.sum(flow.weights * weight)
    across = jnp.sum(2 * grid.half * torque * torque_decay**n)
    late = jnp.sum(2 * grid.half * slow * slow_decay**n)
    degree = jnp.arange(n, dtype=torque.dtype)[None]
    share = jnp.sum(jnp.abs(weight_series[:, ::-1]) * (2 * degree + 1) * torque_decay[:, None] ** degree, axis=1)
    uneven = jnp.sum(grid.half**2 * torque * share) / ((2 * n - 1) * (n + 1))
    everywhere = across + (late + uneven) / gain

    total = jnp.zeros_like(gain)
    for sign, end, height in zip((1, -1), extremes, (found.high, -found.low), strict=True):
        panel, x = end.place.panel, end.place.x
        speed = flow.speed(end.height * end.inertia, end.inertia)
        wave = math.sqrt(8 / (math.pi * (n + 0.5))) * jnp.maximum(1 - x * x, 1 / n**2) ** 0.25 / (2 * n + 1)
        inside = 4 * grid.half[panel] * torque[panel] * wave
        # across an edge (E₀ + W) / J may go on rising; elsewhere, J being known to `stiff` only, it may be higher
        low_end = Reduced(end.inertia, end.slope, before[panel], {})
        high_end = Reduced(end.inertia, end.slope, jnp.roll(after, -1)[panel], {})
        down = -jnp.roll(grid.half, 1)[panel] * flow.rise(low_end, end.height)
        up = jnp.roll(grid.half, -1)[panel] * flow.rise(high_end, end.height)
        beyond = jnp.where(x < -1 + 1e-12, sign * down, jnp.where(x > 1 - 1e-12, sign * up, 0.0))
        top = jnp.max(height, axis=1)
        rival = top + 10 * stiff * jnp.abs(top) - sign * end.height
        rival = jnp.where(jnp.arange(rival.size) == panel, 0.0, rival)
        missed = 4 * end.left + jnp.maximum(beyond, 0.0) + jnp.maximum(jnp.max(rival), 0.0)
        total = total + (1.3 * everywhere + inside) / (end.inertia * speed) + missed / speed
    return total / scene.speed + FLOOR


def _at_edges(flow: Flow) -> tuple[Array, Array, Array]:
    """Reduced inertia at every panel's first edge, and the torque there from inside the panel and from before it."""
    grid, scene = flow.grid, flow.scene
    ahead = grid.middle
    behind = jnp.concatenate([ahead[-1:] - scene.cycle, ahead[:-1]])

    def at(phi, ahead, behind):
        here = pose(scene.mechanism, phi)
        after, before = (reduce_pose(scene, Instant(phi, side, scene.cycle), here) for side in (ahead, behind))
        return after.inertia, after.torque, before.torque

    return jax.vmap(at)(grid.edges[:-1], ahead, behind)


def _missed(series: Float[Array, "panels terms"], low: Array, high: Array) -> Array:
    """The larger difference between the function and its interpolant at the two edges of each panel."""
    sign = (-1.0) ** jnp.arange(series.shape[1])
    return jnp.maximum(jnp.abs(low - series @ sign), jnp.abs(high - jnp.sum(series, axis=1)))


def _decay(series: Float[Array, "panels terms"]) -> Array:
    """Decay of each panel's series from one degree to the next."""
    size, span = jnp.abs(series), min(series.shape[1], 6)
    last = jnp.max(size[:, -2:], axis=1)
    before = jnp.max(size[:, -span : series.shape[1] - span + 2], axis=1)
    return jnp.clip(safe_divide(last, before) ** (1 / (span - 2)), 0.05, 0.9)
