"""The closure equations of links and joints as arrays: configurations and their motion.

Gears in mesh are rows of the same closure. Angles are then unknowns themselves instead of unit vectors, so that
revolutions count, and the multipliers are couples on the gears. Tooth pressure and belt tension are distributed to the
pins afterwards, because separating forces do no work.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._lapack import inverted, pinv, sign_of_determinant, svd
from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._vec import Vec, unit

NEAR = 3  # Newton steps from the reference path


class Found(NamedTuple):
    """A configuration, the mean of its Jacobian's determinant, and its closure error relative to the size of the
    group."""

    z: Array
    sense: Array
    gap: Array


class Known(NamedTuple):
    """Positions of points and directions of links that existed before the group, and angles of those links that its
    gears follow."""

    points: dict[str, Vec]
    links: dict[str, Vec]
    angles: dict[str, Array]


class Placed(NamedTuple):
    """Positions of links: origins and unit vectors along them, shape (links, 2) each; in a group with gears in mesh
    also their angles including whole turns (rad)."""

    at: Array
    u: Array
    angle: Array | None = None

    def moved(self, move: Array, size: Array) -> Placed:
        """Moved by x, y and angle times size of every link. Without angles, twice the tangent of the half angle is used
        instead of the angle, which avoids the sine."""
        move = move.reshape((-1, 3))
        if self.angle is not None:
            angle = self.angle + move[:, 2] / size
            return Placed(self.at + move[:, :2], along(angle), angle)
        half = 0.5 * move[:, 2:] / size
        turned = (self.u * (1 - half * half) + 2 * half * perp(self.u)) / (1 + half * half)
        return Placed(self.at + move[:, :2], turned)

    def later(self, v: Array, t: Array, size: Array, a: Array | None = None) -> Placed:
        """Moved by a crank angle `t` with these rates, to second order."""
        v = v.reshape((-1, 3))
        a = jnp.zeros_like(v) if a is None else a.reshape((-1, 3))
        half, w, e = 0.5 * t * t, v[:, 2:] / size, a[:, 2:] / size
        turned = self.u * (1 - w * w * half) + perp(self.u) * (w * t + e * half)
        angle = None if self.angle is None else self.angle + (w * t + e * half)[:, 0]
        return Placed(self.at + v[:, :2] * t + a[:, :2] * half, turned, angle)

    def flat(self) -> Array:
        """As one array, shape (links, 4), or (links, 3) with angles."""
        return jnp.concatenate([self.at, self.u if self.angle is None else self.angle[:, None]], axis=1)


def placed(z: Array) -> Placed:
    """From one array, whose directions need not have length one."""
    if z.shape[1] == 3:
        return Placed(z[:, :2], along(z[:, 2]), z[:, 2])
    u = z[:, 2:]
    return Placed(z[:, :2], u / safe_sqrt(jnp.sum(u * u, axis=1, keepdims=True), 1.0))


class Geared(NamedTuple):
    """What gears in mesh keep constant, one row each, in m: factors of link angles (rows, links) and of slider
    displacements along slots (rows, slots), and the right-hand sides (rows,), from phases and angles of existing
    links."""

    angles: Array
    ways: Array
    wanted: Array


class Closure(NamedTuple):
    """The values in the closure equations: the position of every pin on its two bodies; point, direction and offset of
    every guide on its body; positions and directions of what the group is attached to; a reference length (m); and the
    coordinate of the drive (m or rad). Bodies are the links of the group, then what it is attached to."""

    near: Array
    far: Array
    through: Array
    axis: Array
    offset: Array
    outer_at: Array
    outer_u: Array
    size: Array
    drive: Array
    geared: Geared | None = None


class ClosureEquations(NamedTuple):
    """The closure equations of a group: the bodies that every pin joins (pins, bodies), the body of every slot's block
    and that of its guide (slots, bodies), and the slot that the drive moves, or the two links that it turns (None for
    the frame)."""

    links: int
    one: Any
    two: Any
    block: Any
    on: Any
    slides: int | None
    turns: tuple[int, int | None] | None

    def opened(self, z: Placed, c: Closure) -> Array:
        """Closure errors of the joints (m): pins, then slots, then gears in mesh, then the drive."""
        at, u = jnp.concatenate([z.at, c.outer_at]), jnp.concatenate([z.u, c.outer_u])
        rows = [((self.one - self.two) @ at + turned(self.one @ u, c.near) - turned(self.two @ u, c.far)).ravel()]
        ways = jnp.zeros(0)
        if len(self.block):
            t, apart, ahead, back = self._slots(at, u, c)
            aside = crossed(t, apart - back) - c.offset
            rows.append(jnp.stack([aside, c.size * crossed(t, ahead)], axis=1).ravel())
            ways = jnp.sum((apart - back) * t, axis=1)
        if c.geared is not None:
            assert z.angle is not None
            rows.append(c.geared.angles @ z.angle + c.geared.ways @ ways - c.geared.wanted)
        if self.slides is not None:
            rows.append((ways - c.drive)[self.slides][None])
        if self.turns is not None:
            wanted, driven = self._turned(z, c)
            rows.append(c.size * crossed(wanted, driven))
        return jnp.concatenate(rows)

    def jacobian(self, z: Placed, c: Closure) -> Array:
        """Derivatives of the closure errors with respect to x, y and angle times size of every link."""
        at, u = jnp.concatenate([z.at, c.outer_at]), jnp.concatenate([z.u, c.outer_u])
        n = self.links
        one, two, block, on = (which[:, :n] for which in (self.one, self.two, self.block, self.on))
        near, far = perp(turned(self.one @ u, c.near)), perp(turned(self.two @ u, c.far))
        spun = (one[:, :, None] * near[:, None] - two[:, :, None] * far[:, None]) / c.size  # (pins, links, 2)
        shifted = jnp.broadcast_to((one - two)[:, :, None, None] * np.eye(2), (*spun.shape, 2))
        parts = [jnp.moveaxis(jnp.concatenate([shifted, spun[..., None]], axis=3), 2, 1).reshape((-1, 3 * n))]
        ways = jnp.zeros((0, 3 * n))
        if len(self.block):
            t, apart, ahead, _ = self._slots(at, u, c)
            which = (block - on)[:, :, None]
            lean = -on * jnp.sum(t * apart, axis=1)[:, None] / c.size
            aside = jnp.concatenate([which * perp(t)[:, None], lean[:, :, None]], axis=2)
            level = which * (jnp.sum(t * ahead, axis=1)[:, None, None] * np.array([[[0.0, 0.0, 1.0]]]))
            parts.append(jnp.stack([aside, level], axis=1).reshape((-1, 3 * n)))
            push = on * jnp.sum(perp(t) * apart, axis=1)[:, None] / c.size
            ways = jnp.concatenate([which * t[:, None], push[:, :, None]], axis=2).reshape((-1, 3 * n))
        if c.geared is not None:
            spun = jnp.zeros((*c.geared.angles.shape, 3)).at[:, :, 2].set(c.geared.angles / c.size)
            parts.append(spun.reshape((-1, 3 * n)) + c.geared.ways @ ways)
        if self.slides is not None:
            parts.append(ways[self.slides][None])
        if self.turns is not None:
            sign = np.zeros((1, n, 3))
            sign[0, self.turns[0], 2] = 1.0
            if self.turns[1] is not None:
                sign[0, self.turns[1], 2] = -1.0
            wanted, driven = self._turned(z, c)
            parts.append((jnp.asarray(sign) * jnp.sum(wanted * driven)).reshape((1, -1)))
        return jnp.concatenate(parts)

    def near(self, z: Placed, c: Closure, sense: Array) -> Placed:
        """The configuration that closes the joints to about rounding, from one nearby; without derivatives.

        Plain or damped Newton steps had errors of 4e-9 at 1e-6 from a fold, without notice, and never came below 3e-5
        at 1e-8. Two of these steps instead of three left a closure error of 4e-10 beside a fold between two points of
        the path. `General` takes two more steps with a fixed inverse.
        """
        return jax.lax.fori_loop(0, NEAR, lambda _, z: self._nearer(z, c, sense), z)

    def _nearer(self, z: Placed, c: Closure, sense: Array) -> Placed:
        """A step of Newton's method that handles folds, to the root where the Jacobian's determinant has this sign.

        Where two assembly modes coincide, the closure is quadratic along the nearly singular direction v, and Newton's
        method loses half of its digits. Therefore this direction is split off: w is the vector for which |wᵀ J| is
        least, and J v = w / |J⁻¹ w|, whatever the accuracy of w. Of the two roots along v, the one with the sign
        `sense` is taken.
        Source: D. W. Decker, C. T. Kelley, Newton's method at singular points, SIAM J. Numer. Anal. 17 (1980).
        """
        gap, jacobian = self.opened(z, c), self.jacobian(z, c)
        inverse = inverted(jacobian)
        v = _normed(inverse @ jnp.cos(1.0 + 1.7 * np.arange(gap.size)))
        w = _normed(inverse.T @ _normed(inverse @ _normed(inverse.T @ v)))
        v, rest = _normed(inverse @ w), -inverse @ (gap - w * (w @ gap))

        def left(t):
            return w @ self.opened(z.moved(rest + t * v, c.size), c)

        none, one = jnp.zeros_like(c.size), jnp.ones_like(c.size)
        value, slope = jax.jvp(left, (none,), (one,))
        bend = jax.jvp(lambda t: jax.jvp(left, (t,), (one,))[1], (none,), (one,))[1]
        wanted = sense * sign_of_determinant(jacobian)  # sign of the slope at the root: it is positive here
        root = wanted * safe_sqrt(slope * slope - 2 * bend * value)
        here = slope * wanted > 0
        t = safe_divide(jnp.where(here, -2 * value, root - slope), jnp.where(here, slope + root, bend))
        move = rest + t * v
        move = jnp.where(jnp.all(jnp.isfinite(move)), move, 0.0)
        most = jnp.maximum(jnp.max(jnp.abs(move)), jnp.finfo(move.dtype).tiny)
        return z.moved(move * jnp.minimum(1.0, 0.5 * c.size / most), c.size)

    def implicit(self, z: Placed, c: Closure, sound: Array) -> Placed:
        """A configuration that closes the joints, with the derivatives of the root, of any order; without derivatives
        where it is not `sound`.

        To differentiate through the last steps took one more step for every order, and reduced the accuracy of second
        derivatives near singularities, where it multiplies rounding errors by the condition number twice. Derivatives
        are refined once, as are the rates in `General.solve`, which use the same Jacobian: at a least singular value of
        5e-4 the rounding errors of the inverse made an acceleration wrong by 5.7e-12, now 2e-13.
        """

        @jax.custom_jvp
        def root(z, c, sound):
            return z

        @root.defjvp
        def _rule(given, moving):
            here, c, sound = root(*given), *given[1:]
            push = jax.jvp(lambda c: self.opened(here, c), (c,), (moving[1],))[1]
            matrix = self.jacobian(here, c)
            inverse = inverted(jnp.where(sound, matrix, jnp.eye(push.size)))
            x = -inverse @ push
            x = jnp.where(sound, x - inverse @ (matrix @ x + push), 0.0).reshape((-1, 3))
            turn = x[:, 2:] / c.size
            return here, Placed(x[:, :2], perp(here.u) * turn, None if here.angle is None else turn[:, 0])

        return root(z, c, sound)

    def gears_open(self, at: Array, angle: Array, c: Closure) -> Array:
        """Closure error of every gear mesh (m)."""
        assert c.geared is not None
        row = 2 * (len(self.one) + len(self.block))
        return self.opened(Placed(at, along(angle), angle), c)[row : row + c.geared.wanted.size]

    def following(self, z: Array, c: Closure, loose: np.ndarray, arm: Array) -> Array:
        """A configuration with free gears turned into mesh with the others, about their points at `arm`."""
        assert c.geared is not None
        at, angle = z[:, :2], z[:, 2]
        true = angle.at[loose].add(-pinv(c.geared.angles[:, loose]) @ self.gears_open(at, angle, c))
        at = at + turned(along(angle), arm) - turned(along(true), arm)
        return jnp.concatenate([at, true[:, None]], axis=1)

    def reversed(self, z: Placed, c: Closure) -> Array:
        """Whether a slider, or the link that the drive turns, is reversed by half a turn, which the equations also
        allow."""
        ahead = [jnp.ones(1)]
        if len(self.block):
            at, u = jnp.concatenate([z.at, c.outer_at]), jnp.concatenate([z.u, c.outer_u])
            t, _, block, _ = self._slots(at, u, c)
            ahead.append(jnp.sum(t * block, axis=1))
        if self.turns is not None:
            ahead.append(jnp.sum(jnp.multiply(*self._turned(z, c)), axis=1))
        return jnp.any(jnp.concatenate(ahead) < 0)

    def _slots(self, at: Array, u: Array, c: Closure) -> tuple[Array, Array, Array, Array]:
        """For every slot: direction of the guide, vector from the origin of its body to the block, direction of the
        block, and vector from that origin to the point that the guide passes through."""
        turn = self.on @ u
        return turned(turn, c.axis), (self.block - self.on) @ at, self.block @ u, turned(turn, c.through)

    def _turned(self, z: Placed, c: Closure) -> tuple[Array, Array]:
        """The prescribed and the actual direction of the link that the drive turns."""
        assert self.turns is not None
        link, on = self.turns
        wanted = array([unit(c.drive)])
        return wanted if on is None else turned(z.u[on : on + 1], wanted), z.u[link : link + 1]


def _normed(x: Array) -> Array:
    """A vector of length one."""
    return x / jnp.sqrt(jnp.sum(x * x))


def array(vectors: Sequence[Vec]) -> Array:
    """Vectors as rows."""
    if not vectors:
        return jnp.zeros((0, 2))
    return jnp.stack([jnp.stack([v.x for v in vectors]), jnp.stack([v.y for v in vectors])], axis=1)


def along(angle: Array) -> Array:
    """Unit vectors at these angles as rows."""
    return jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=1)


def turned(u: Array, at: Array) -> Array:
    """Rows given in axes whose directions are the rows of `u`, transformed to the axes of the frame."""
    return at * u[:, :1] + perp(at) * u[:, 1:]


def crossed(a: Array, b: Array) -> Array:
    """Cross products of rows."""
    return jnp.sum(perp(a) * b, axis=1)


def perp(a: Array) -> Array:
    """Rows turned by +90 degrees."""
    return jax.lax.rev(a, (1,)) * np.array([[-1.0, 1.0]])


def least_singular(matrix: Array, first: Array, second: Array) -> tuple[Array, Array, Array]:
    """The least singular value of a matrix, with first and second derivatives from those of the matrix. The result can
    be differentiated once.

    Source: perturbation of a simple singular value, e.g. Stewart and Sun, Matrix Perturbation Theory, 1990.
    """
    left, sizes, right = svd(matrix)
    u, v = left[:, -1], right[-1]
    p = left.T @ first @ right.T
    a, b, s = p[:-1, -1], p[-1, :-1], sizes[:-1]
    least = sizes[-1]
    bend = safe_divide(least * (a * a + b * b) + 2 * s * a * b, (least - s) * (least + s))
    return u @ matrix @ v, p[-1, -1], u @ second @ v + jnp.sum(bend)
