"""Error bound of δ, from the interpolation errors at the panels' edges and the decay of their Legendre series.

A function interpolated at the n Gauss nodes of a panel has the error P_n(x) h(x), and P_n is ±1 at an edge, so one more
evaluation there gives h. Integrals have the error of the part of h of degree n, which is smaller by the decay of the
series to the power n (about ρ^n (2j + 1) for a pole). The work inside a panel has the error h times the integral of
P_n.

An error that shifts both extremes equally (the energy constant) counts only by its difference; a rival extreme between
nodes by the error of a cubic over two cells; a misplaced reversal by the last Newton step. An estimate from the decay
alone had to be fitted to designs and was a hundred times looser.
Source: Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, ch. 11 and 19; the safety factors were
checked on random designs, see `tests/physics/test_delta_error.py`.
"""

from __future__ import annotations

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._numerics import nearest_turn, safe_divide, taken
from linkjax.motion._flow import Ends, Flow, Spots
from linkjax.motion._nodes import AtEdges

FLOOR, ROUNDINGS = 2e-11, 60.0  # the least error stated: an absolute one, and rounding units of the largest speed


def delta_error(flow: Flow, energy: Array, extremes: Ends, edges: AtEdges, spots: Spots) -> Array:
    """Bound of the absolute error of δ, from values at the edges of the panels and the pieces between the nodes."""
    grid, duty, n = flow.grid, flow.duty, flow.grid.n
    spectrum = jnp.asarray(grid.rule.spectrum.T)
    slowness = 1 / flow.speed(energy + flow.at_nodes, flow.inertia)
    weight = slowness / flow.running(energy + flow.at_nodes)  # twice the decrease of the period per unit of energy
    torque_series, slow_series, weight_series = flow.here.torque @ spectrum, slowness @ spectrum, weight @ spectrum

    inertia, after, before = jnp.maximum(edges.inertia + flow.added, flow.floor), edges.after, edges.before
    work = flow.work.at_edges[:-1]
    at_edges = 1 / flow.speed(energy + work, inertia)
    torque = _missed(torque_series, after, jnp.roll(before, -1))
    slow = _missed(slow_series, at_edges, jnp.roll(at_edges, -1))
    found, doubtful = spots.pieces, spots.doubt
    places = grid.middle[:, None] + grid.half[:, None] * found.x
    torque_decay, slow_decay = _decay(torque_series, (2,), 0.7), _decay(slow_series[:, 1:], (1, 2), 0.8)

    gain = 0.5 * jnp.sum(flow.weights * weight)
    across = jnp.sum(2 * grid.half * torque * torque_decay**n) + grid.doubt
    late = jnp.sum(2 * grid.half * slow * slow_decay**n)
    if flow.driven is not None and flow.driven.torques.rough is not None:
        across = across + _rounded(flow, torque_series, after, jnp.roll(before, -1))
    degree = jnp.arange(n, dtype=torque.dtype)[None]
    share = jnp.sum(jnp.abs(weight_series[:, ::-1]) * (2 * degree + 1) * torque_decay[:, None] ** degree, axis=1)
    uneven = jnp.sum(grid.half**2 * torque * share) / ((2 * n - 1) * (n + 1))
    shift = (late + uneven) / gain  # error of the energy constant, which shifts both extremes

    speeds = flow.speeds(extremes)
    high, low = 1 / (extremes.inertia * speeds)
    unit = duty.speed
    if flow.driven is not None:  # an error of the work over the cycle is divided by what a cycle leaves of it
        unit = 0.5 * jnp.sum(speeds)
        shift = safe_divide(across, jnp.abs(1 - flow.driven.kept), jnp.inf)
        if flow.driven.torques.motor is None:  # the wanted mean speed fixes the energy
            shift = (late + uneven) / gain + across
    total = 2.5 * shift * (jnp.abs(high - low) + 0.02 * (high + low))
    if flow.driven is not None:  # the mean speed changes, too
        total = total + shift * 0.5 * (high + low) * jnp.abs(speeds[0] - speeds[1]) / unit
    after_next, width = jnp.roll(after, -1), grid.half

    def share_of(sign, height, end, speed):
        """The part of the error that belongs to one extreme."""
        panel, x = end.place.panel, end.place.x
        wave = math.sqrt(8 / (math.pi * (n + 0.5))) * jnp.maximum(1 - x * x, 1 / n**2) ** 0.25 / (2 * n + 1)
        inside = 5 * taken(width * torque, panel) * wave
        # (E₀ + W) / J may still rise past an edge, or be higher between two nodes elsewhere
        rise = jnp.stack([-jnp.roll(width, 1) * before, jnp.roll(width, -1) * after_next])
        slope = jnp.stack([-jnp.roll(width, 1), jnp.roll(width, -1)])
        offset = flow.drive - end.height * end.slope
        down, up = taken((rise + slope * offset).T, panel) / end.inertia
        beyond = jnp.where(x < -1 + 1e-12, sign * down, jnp.where(x > 1 - 1e-12, sign * up, 0.0))
        away = [jnp.abs(nearest_turn(places - seen, duty.cycle)) for seen in (end.place.phi, end.other)]
        near = jnp.minimum(*away) < (3 / n) * (width[:, None] + taken(width, panel))
        rival = jnp.max(jnp.where(near, -jnp.inf, height + doubtful)) - sign * end.height
        missed = 4 * end.left + jnp.maximum(beyond, 0.0) + jnp.maximum(rival, 0.0)
        return (1.3 * across + inside) / (end.inertia * speed) + missed / speed

    heights = jnp.stack([found.high, -found.low])
    total = total + jnp.sum(jax.vmap(share_of)(jnp.asarray([1.0, -1.0], total.dtype), heights, extremes, speeds))
    return (total + ROUNDINGS * jnp.finfo(total.dtype).eps * speeds[0]) / unit + FLOOR


def _rounded(flow: Flow, series: Float[Array, "panels terms"], low: Array, high: Array) -> Array:
    """The integral of what rounds the kinks of a function at the edges of panels, too narrow for the nodes.

    Near a place where the force of a pin with friction almost vanishes its size is s √(d² + x²), and the panels beside
    see s |x|. At the edge the difference is s d, their slopes differ by 2 s, and the integral of the difference is
    s d² (½ + ln(2 h / d)) up to the distance h. Functions that the nodes resolve have smaller slopes there.
    """
    half, n, count = flow.grid.half, flow.grid.n, np.arange(series.shape[1])
    sign, rise = jnp.asarray((-1.0) ** count), jnp.asarray(0.5 * count * (count + 1.0))
    left, right = low - series @ sign, high - jnp.sum(series, axis=1)
    begins, ends = -(series * rise[None]) @ sign / half, series @ rise / half
    left, begins, after = (jnp.roll(part, -1) for part in (left, begins, half))
    missed = jnp.where(left * right > 0, jnp.minimum(jnp.abs(left), jnp.abs(right)), 0.0)
    kink, width = jnp.abs(begins - ends), jnp.minimum(half, after)
    far = safe_divide(kink * width, missed)
    area = safe_divide(2 * missed**2, kink) * (0.5 + jnp.log(jnp.maximum(2 * far, 1.0)))
    return jnp.sum(jnp.where(far > n * n, area, 0.0))


def _missed(series: Float[Array, "panels terms"], low: Array, high: Array) -> Array:
    """The larger difference between the function and its interpolant at the two edges of each panel."""
    sign = jnp.asarray((-1.0) ** np.arange(series.shape[1]), dtype=series.dtype)
    return jnp.maximum(jnp.abs(low - series @ sign), jnp.abs(high - jnp.sum(series, axis=1)))


def _decay(series: Float[Array, "panels terms"], pairs: tuple[int, ...], most: float) -> Array:
    """Decay of each panel's series per degree: the last pair of terms relative to earlier pairs."""
    size, count = jnp.abs(series), series.shape[1]
    last, rates = jnp.max(size[:, -2:], axis=1), []
    for back in (min(2 * pair, count - 2) for pair in pairs):
        before = jnp.max(size[:, count - 2 - back : count - back], axis=1)
        rates.append(safe_divide(last, before) ** (1 / back))
    return jnp.clip(functools.reduce(jnp.maximum, rates), 0.05, most)
