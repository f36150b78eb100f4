"""Extremes of a function over the continuous cycle.

A function known with its slope at the nodes is taken as a cubic between neighbours (`pieces`). One known only by value
is searched on a fine grid (`search`), and its extreme refined on the interpolant (`climb`). Both results are then
refined on the function itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from linkjax._numerics import envelope, highest, nearest_turn, once, safe_divide, safe_sqrt, stepped, taken
from linkjax.motion._grid import Grid, Place
from linkjax.motion._panels import Rule

SAME = 1e-7  # rad: ends of panels that are closer are one
CONTINUOUS = 1e-6  # of the greatest height: a function that differs less at the two sides of an edge is continuous


class Pieces(NamedTuple):
    """Cubic pieces of a function between the nodes and ends of every panel: the highest and lowest value of each piece,
    the coordinate `x` of its extreme, and the magnitude of the second derivative with respect to x there (`bend`)."""

    high: Float[Array, "panels pieces"]
    low: Float[Array, "panels pieces"]
    x: Float[Array, "panels pieces"]
    bend: Float[Array, "panels pieces"]


def pieces(rule: Rule, value: Float[Array, "panels points"], slope: Float[Array, "panels points"]) -> Pieces:
    """Cubic pieces of a function, from values and slopes (with respect to x) at the low end, nodes and high end."""
    count = rule.points.size - 1
    low, width = (np.tile(part, value.shape[0]) for part in (rule.points[:-1], np.diff(rule.points)))
    low, width = jnp.asarray(low), jnp.asarray(width)
    y0, y1, m0, m1 = (part.ravel() for part in (value[:, :-1], value[:, 1:], slope[:, :-1], slope[:, 1:]))
    m0, m1, rise = m0 * width, m1 * width, y1 - y0
    c2, c3 = once(3 * rise - 2 * m0 - m1), once(m0 + m1 - 2 * rise)
    turns, top = m0 * m1 < 0, m0 > 0
    root = safe_sqrt(c2 * c2 - 3 * c3 * m0)
    sense = jnp.where(top, 1.0, -1.0)  # a maximum, or a minimum
    s = jnp.where(turns, jnp.clip(safe_divide(sense * m0, root - sense * c2), 0.0, 1.0), jnp.where(rise > 0, 1.0, 0.0))
    s = once(s)
    there = once(y0 + s * (m0 + s * (c2 + s * c3)))
    high = jnp.where(turns & top, there, jnp.maximum(y0, y1))
    low_value = jnp.where(turns & ~top, there, jnp.minimum(y0, y1))
    bend = jnp.maximum(jnp.abs(2 * c2 + 6 * c3 * s), 1e-3 * (jnp.abs(m0) + jnp.abs(m1))) / (width * width)
    shape = (value.shape[0], count)
    return Pieces(*(part.reshape(shape) for part in (high, low_value, low + s * width, bend)))


def best_piece(found: Pieces, height: Array) -> tuple[Array, Array, Array]:
    """Panel, coordinate and bend of the highest piece; by masked maxima, which vectorise, unlike an argmax."""
    best = highest(height)
    number = jnp.broadcast_to(jnp.arange(height.shape[0], dtype=jnp.int32)[:, None], height.shape)
    panel = jnp.max(jnp.where(best, number, 0))
    best &= number == panel
    x, bend = (jnp.max(jnp.where(best, part, -jnp.inf)) for part in (found.x, found.bend))
    return panel, x, bend


def newton(x: Array, tilt: Array, bend: Array) -> Array:
    """Newton's step towards a maximum, inside the panel."""
    return jnp.clip(safe_divide(tilt, bend), jnp.maximum(-1.0 - x, -0.5), jnp.minimum(1.0 - x, 0.5))


def doubt(rule: Rule, value: Float[Array, "panels points"], slope: Float[Array, "panels points"]) -> Array:
    """Error estimate of each cubic piece: the error of a cubic over twice its width at the omitted point, reduced."""
    points = rule.points[None]
    wide = points[:, 2:] - points[:, :-2]
    width, s = jnp.asarray(wide), jnp.asarray((points[:, 1:-1] - points[:, :-2]) / wide)
    rise, m0, m1 = value[:, 2:] - value[:, :-2], slope[:, :-2] * width, slope[:, 2:] * width
    cubic = value[:, :-2] + s * (m0 + s * (3 * rise - 2 * m0 - m1 + s * (m0 + m1 - 2 * rise)))
    missed = 0.25 * jnp.abs(cubic - value[:, 1:-1])  # the fourth power of the width would give 1/16
    return jnp.maximum(jnp.pad(missed, ((0, 0), (0, 1)), mode="edge"), jnp.pad(missed, ((0, 0), (1, 0)), mode="edge"))


class Summit(NamedTuple):
    """The highest point of a search grid: panel, coordinate of the vertex of the parabola through it and its
    neighbours, distance of these, and second derivative with respect to x (negative)."""

    panel: Int[Array, ""]
    x: Array
    reach: Array
    bend: Array


def summit_heights(fine: Array, height: Float[Array, "panels fine"]) -> tuple[Array, Array, Array]:
    """Of every panel the height of its highest summit, as the vertex of a parabola: the search grid alone may miss
    it by more than another summit is lower. And whether the function only falls from the low end, where it continues
    the panel before, or only rises to the high end, where it continues in the next one."""
    height = jax.lax.stop_gradient(height)
    points, top = height.shape[1], jnp.max(height, axis=1)
    i = jnp.argmax(height, axis=1)
    j = jnp.clip(i, 1, points - 2)[:, None] + jnp.arange(-1, 2)[None]
    x, y = fine[j], jnp.take_along_axis(height, j, axis=1)
    left, right = (y[:, 1] - y[:, 0]) / (x[:, 1] - x[:, 0]), (y[:, 2] - y[:, 1]) / (x[:, 2] - x[:, 1])
    slope = (left * (x[:, 2] - x[:, 1]) + right * (x[:, 1] - x[:, 0])) / (x[:, 2] - x[:, 0])
    bend = (right - left) / (x[:, 2] - x[:, 0])
    inside = (i == j[:, 1]) & (bend < 0)
    raised = jnp.where(inside, top - 0.25 * safe_divide(slope**2, bend), top)
    before, after = jnp.roll(height[:, -1], 1), jnp.roll(height[:, 0], -1)
    same = CONTINUOUS * jnp.max(top)
    begins = (i == 0) & (jnp.abs(before - height[:, 0]) <= same)
    ends = (i == points - 1) & (jnp.abs(after - height[:, -1]) <= same)
    return raised, begins, ends


def search(fine: Array, height: Float[Array, "panels fine"], tops: Float[Array, " panels"] | None = None) -> Summit:
    """The summit of a function given on the search grid of every panel; `tops` is -inf for panels to exclude."""
    height = jax.lax.stop_gradient(height)
    best = highest(jnp.max(height, axis=1) if tops is None else tops)
    panel = jnp.max(jnp.where(best, jnp.arange(best.size, dtype=jnp.int32), 0))
    panel, i = _right_panel(fine, height, panel, jnp.argmax(height[panel]))
    return _summit(fine, height[panel], panel, i)


def highest_in(fine: Array, height: Float[Array, " fine"], panel: Int[Array, ""]) -> Summit:
    """The summit within one panel; it may be at an end."""
    height = jax.lax.stop_gradient(height)
    return _summit(fine, height, panel, jnp.argmax(height))


def _summit(fine: Array, height: Array, panel: Array, i: Array) -> Summit:
    """The vertex of the parabola through the highest point and its neighbours."""
    points = height.shape[0]
    j = jnp.clip(i, 1, points - 2)
    x, y = fine[j + jnp.arange(-1, 2)], height[j + jnp.arange(-1, 2)]
    left = (y[1] - y[0]) / (x[1] - x[0])
    right = (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (0.5 * (x[2] - x[0]))
    vertex = 0.5 * (x[0] + x[2]) - safe_divide((y[2] - y[0]) / (x[2] - x[0]), bend)
    low, high = fine[jnp.maximum(i - 1, 0)], fine[jnp.minimum(i + 1, points - 1)]
    start = jnp.clip(jnp.where(bend < 0, vertex, fine[i]), low, high)
    return Summit(panel, start, high - low, jnp.where(bend < 0, bend, -1.0))


def climb(slope: Callable[[Array], Array], summit: Summit, steps: int, rolled: bool) -> Array:
    """The coordinate near a summit where the slope vanishes, or the end of the panel. Each secant step evaluates the
    slope once and is at most `reach` long. Not differentiated: to first order an extreme value does not depend on its
    position.
    """

    def step(i, state):
        x, before, rise_before, bend = state
        rise = slope(x)
        secant = safe_divide(rise - rise_before, x - before)
        bend = jnp.where((secant < 0) & (i > 0), secant, bend)
        move = jnp.clip(-rise / bend, -summit.reach, summit.reach)
        return jnp.clip(x + move, -1.0, 1.0), x, rise, bend

    state = (summit.x, summit.x, jnp.zeros_like(summit.x), summit.bend)
    return jax.lax.stop_gradient(stepped(steps, step, state, rolled)[0])


Held = tuple[tuple[float, ...], ...]  # for every quantity, the crank angles (rad) at which its own range ends


def settle(grid: Grid, panel: Array, x: Array, held: Held = ()) -> Place:
    """The place found, of quantities along the first axis. Its derivative is that of the panel's edge if it is at an
    edge, and excludes the search (envelope theorem). An edge at which the range of the quantity itself ends does not
    move, whatever else switches there; `held` has these angles of all quantities, or is empty.

    Inside a panel the angle is fixed while the panel's edges move with the design, so `x` changes.
    """
    inside = jax.lax.stop_gradient(jnp.abs(x) < 1)
    end = jax.lax.stop_gradient(jnp.where(x < 0, -1.0, 1.0))
    (_, _, edge, middle), angle = grid.at(panel, end), grid.at(panel, x).phi
    for k in range(max(map(len, held), default=0)):
        own = np.asarray([len(each) > k for each in held])
        fixed = np.asarray([each[k] if len(each) > k else 0.0 for each in held])
        own, fixed = (part.reshape((-1, *[1] * (edge.ndim - 1))) for part in (own, fixed))
        at_end = own & (jnp.abs(nearest_turn(edge - fixed, grid.length)) < SAME)
        edge = jnp.where(at_end, jax.lax.stop_gradient(edge), edge)
    drift = safe_divide(jax.lax.stop_gradient(angle) - middle, taken(grid.half, panel))  # zero for no width
    phi = envelope(jnp.where(inside, angle, edge), jnp.where(inside, 0.0, edge - jax.lax.stop_gradient(edge)))
    moves = jnp.where(inside, drift - jax.lax.stop_gradient(drift), 0.0)
    return Place(panel, envelope(jnp.where(inside, x, end), moves), phi, middle)


def _right_panel(fine, height, panel, i):
    """An extremum found on an edge belongs to the neighbouring panel if the function still rises (or fell) there."""
    panels, points = height.shape
    after, before = (panel + 1) % panels, (panel - 1) % panels
    jump = 1e-4 * (jnp.max(height) - jnp.min(jnp.where(jnp.isfinite(height), height, jnp.inf)))
    other = jnp.where(i == 0, height[before, -1], height[after, 0])
    joined = jnp.isfinite(other) & (height[panel, i] - other <= jump)  # else a real corner
    forward = (i == points - 1) & joined & (_end_slope(fine[:3], height[after, :3]) > 0)
    backward = (i == 0) & joined & (_end_slope(fine[-1:-4:-1], height[before, -1:-4:-1]) < 0)
    panel = jnp.where(forward, after, jnp.where(backward, before, panel))
    return panel, jnp.where(forward, 0, jnp.where(backward, points - 1, i))


def _end_slope(x, y):
    """Slope at the first of three points of the parabola through them."""
    near = (y[1] - y[0]) / (x[1] - x[0])
    far = (y[2] - y[1]) / (x[2] - x[1])
    return near + (x[0] - x[1]) * (far - near) / (x[2] - x[0])
