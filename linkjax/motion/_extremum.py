"""Extremes of a function over the continuous cycle: found on a search grid, sharpened on the function itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from linkjax._numerics import envelope, root, safe_divide
from linkjax.motion._grid import Grid

SHARPEN = 2  # evaluations of the slope after the search grid


class Place(NamedTuple):
    """A position on the grid: panel number, place `x` in [-1, 1] within it, and the crank angle (rad)."""

    panel: Int[Array, ""]
    x: Array
    phi: Array


def phi_at(grid: Grid, panel: Array, x: Array) -> Array:
    """Crank angle (rad) at the place `x` of a panel."""
    return grid.middle[panel] + grid.half[panel] * x


def find_maximum(
    grid: Grid, values: Float[Array, "panels fine"], slope: Callable[[Place], Array], sign: Array | float = 1.0
) -> tuple[Place, Array]:
    """Where `sign` times a function is largest, and how far the last step moved it (in x).

    `values` are the function on the search grid of every panel; `slope(place)` its derivative by x, exact, one-sided
    inside the panel. The place carries the derivative of a moving edge and none of the search (envelope theorem).
    Costs `SHARPEN` evaluations of the slope.
    """
    fine = jnp.asarray(grid.rule.fine, dtype=values.dtype)
    points = values.shape[1]
    height = jax.lax.stop_gradient(sign * values)
    flat = jnp.argmax(height)
    panel, i = flat // points, flat % points
    panel, i = _right_panel(fine, height, panel, i)
    j = jnp.clip(i, 1, points - 2)
    x3, y3 = fine[j + jnp.arange(-1, 2)], height[panel, j + jnp.arange(-1, 2)]
    bend = _bend(x3, y3)
    tilt = safe_divide(y3[2] - y3[0], x3[2] - x3[0])
    # vertex of the parabola through the three points
    middle = 0.5 * (x3[0] + x3[2])
    start = jnp.clip(jnp.where(bend < 0, middle - safe_divide(tilt, bend), fine[i]), -1.0, 1.0)

    def rising(x):
        return sign * slope(Place(panel, x, phi_at(grid, panel, x)))

    def solve(function, x):
        steep = jnp.where(bend < 0, bend, -1.0)
        rise = function(x)
        for _ in range(SHARPEN - 1):
            new = jnp.clip(x - rise / steep, -1.0, 1.0)
            rise_new = function(new)
            secant = safe_divide(rise_new - rise, new - x)
            steep = jnp.where((secant < 0) & (jnp.abs(new) < 1), secant, steep)
            x, rise = new, rise_new
        return jnp.clip(x - rise / steep, -1.0, 1.0)

    x = root(rising, start, solve)
    inside = jax.lax.stop_gradient(jnp.abs(x) < 1)
    nearest_edge = jax.lax.stop_gradient(jnp.where(x < 0, -1.0, 1.0))
    edge = phi_at(grid, panel, nearest_edge)
    fixed = jax.lax.stop_gradient(edge)
    phi = envelope(jnp.where(inside, phi_at(grid, panel, x), fixed), jnp.where(inside, 0.0, edge - fixed))
    x = envelope(jnp.where(inside, x, nearest_edge), jnp.zeros_like(x))
    return Place(panel, x, phi), jax.lax.stop_gradient(jnp.abs(x - start))


def _bend(x, y):
    """Second derivative of the parabola through three points."""
    left = safe_divide(y[1] - y[0], x[1] - x[0])
    right = safe_divide(y[2] - y[1], x[2] - x[1])
    return safe_divide(right - left, 0.5 * (x[2] - x[0]))


def _right_panel(fine, height, panel, i):
    """An extremum found on an edge lies inside the neighbour when the function still rises (or fell) there."""
    panels, points = height.shape
    after, before = (panel + 1) % panels, (panel - 1) % panels
    forward = (i == points - 1) & (_end_slope(fine[:3], height[after, :3]) > 0)
    backward = (i == 0) & (_end_slope(fine[-1:-4:-1], height[before, -1:-4:-1]) < 0)
    panel = jnp.where(forward, after, jnp.where(backward, before, panel))
    return panel, jnp.where(forward, 0, jnp.where(backward, points - 1, i))


def _end_slope(x, y):
    """Slope at the first of three points, of the parabola through them."""
    near = (y[1] - y[0]) / (x[1] - x[0])
    far = (y[2] - y[1]) / (x[2] - x[1])
    return near + (x[0] - x[1]) * (far - near) / (x[2] - x[0])
