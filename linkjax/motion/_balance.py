"""Work over the cycle by source: what every torque on the crank gives and what it takes.

All torques are power divided by the crank speed, so that their integrals over the crank angle are works. Between nodes
they are the polynomials of the panels, whose zeros separate what is given from what is taken.
Source: work-energy theorem of a machine, Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 14.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_sqrt
from linkjax.drives import MotorDrive
from linkjax.motion._by_speed import BySpeed
from linkjax.motion._flow import primitive
from linkjax.motion._grid import Grid
from linkjax.motion._panels import rule, series_sum
from linkjax.motion._steady import Steady
from linkjax.reduction import Reduced

HALVINGS = 40  # bisections of a zero of a torque between two points of the search grid


class Work(NamedTuple):
    """Work over the cycle (J), zero or more: `supplied` to the machine and `absorbed` from it."""

    supplied: Array
    absorbed: Array

    @property
    def net(self) -> Array:
        """The work on the machine (J): supplied minus absorbed."""
        return self.supplied - self.absorbed


@compiled_soon
def split_work(half: Float[Array, " panels"], torques: tuple[Float[Array, "panels n"], ...]) -> tuple[Work, ...]:
    """What each torque (N m) supplies and absorbs, from its values at the nodes of panels of this half width (rad)."""
    return tuple(Work(*both) for both in zip(*_split(half, jnp.stack(torques)), strict=True)) if torques else ()


def _split(half: Array, values: Float[Array, "torques panels n"]) -> tuple[Array, Array]:
    by = rule(values.shape[-1])
    series, whole = values @ jnp.asarray(by.series.T), values @ jnp.asarray(by.primitive.T)
    shape = (*values.shape[:2], by.fine.size - 1)
    low, high = (jnp.broadcast_to(jnp.asarray(x, values.dtype), shape) for x in (by.fine[:-1], by.fine[1:]))
    fixed, first = jax.lax.stop_gradient((_at_each(series, shape), values @ jnp.asarray(by.to_fine[:-1].T)))

    def halve(_: Any, at: tuple[Array, Array]) -> tuple[Array, Array]:
        middle = 0.5 * (at[0] + at[1])
        before = first * series_sum(fixed, middle) > 0
        return jnp.where(before, middle, at[0]), jnp.where(before, at[1], middle)

    below, above = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
    zero = series_sum(_at_each(whole, shape), 0.5 * (below + above))  # at the high end where the sign is kept
    ends = whole @ jnp.asarray(chebyshev.chebvander(by.fine, by.x.size).T)
    steps = jnp.stack([zero - ends[..., :-1], ends[..., 1:] - zero])
    gained, lost = (jnp.sum(jnp.where(part > 0, part, 0.0), axis=(0, -1)) @ half for part in (steps, -steps))
    return gained, lost


def _at_each(series: Array, shape: tuple[int, ...]) -> Array:
    """The series of every panel, for each of several places."""
    return jnp.broadcast_to(series[..., None, :], (*shape, series.shape[-1]))


def unnamed(grid: Grid) -> Grid:
    """The grid without the names of the loads, so that programs do not depend on them."""
    return dataclasses.replace(grid, loads=(), passages=(), breaks=(), evaluations=0)


def drive_work(
    motor: MotorDrive | None, grid: Grid, steady: Steady | None, here: Reduced, slope: Any, nominal: Any,
    rotor: Array | None = None,
) -> tuple[Work, Array | None]:  # fmt: skip
    """Work of the drive (J): at the shaft of the `motor`, or on the crank without one; and what its transmission loses
    (None: nothing).

    `here` is the reduced model of all loads at the nodes of the grid, `slope` the bare slope of the reduced inertia
    there. Without a motion, or with a prescribed one, the crank turns at the `nominal` speed (rad/s), and the drive
    gives what inertia and loads require, and the motor of a motion law the power of its `rotor`, divided by the crank
    speed (N m at the nodes); otherwise it is the constant torque, or the motor by its characteristic.
    """
    moved = None if steady is None or grid.prescribed else steady
    if moved is None:
        given = grid.half, slope, tuple(here.by_load.values()), nominal
        work = _required(*given)
        if motor is None:
            return work, None
        shaft, loss = _at_shaft(motor, work)
        return (shaft if rotor is None else _with_rotor(motor, *given, rotor, shaft.net)), loss
    if moved.driven is None or motor is None:
        mean = moved.mean_drive_torque * grid.length
        return Work(jnp.maximum(mean, 0.0), jnp.maximum(-mean, 0.0)), None
    work, given = moved.work, (moved.energy, moved.inertia_floor, moved.driven.constant)
    shaft, loss = _by_characteristic(
        motor, unnamed(grid), here._replace(by_load={}), work.at_edges, work.series, *given
    )
    (given,) = split_work(grid.half, (shaft,))
    return given, loss if motor.transmission.loses else None


@compiled_soon
def _required(half: Array, slope: Array, shares: tuple[Array, ...], nominal: Array) -> Work:
    """Work of a drive that keeps the speed. Its sum is that of the loads exactly: inertia does no work in a cycle."""
    torque = sum(shares, jnp.zeros_like(shares[0]))
    weights = half[:, None] * rule(torque.shape[-1]).w[None]
    return _split_to(half, _on_crank(slope, shares, nominal), -jnp.sum(weights * torque))


def _on_crank(slope: Array, shares: tuple[Array, ...], nominal: Array) -> Array:
    """Torque of a drive that keeps the speed (N m), at the nodes."""
    torque = sum(shares, jnp.zeros_like(shares[0]))
    return 0.5 * slope[: torque.size].reshape(torque.shape) * nominal**2 - torque


def _split_to(half: Array, torque: Array, net: Array) -> Work:
    """What a torque supplies and absorbs, with a net work that is known."""
    (gained,), (lost,) = _split(half, torque[None])
    more, drives = net - (gained - lost), gained > lost
    return Work(gained + jnp.where(drives, more, 0.0), lost - jnp.where(drives, 0.0, more))


@compiled_soon
def _at_shaft(motor: MotorDrive, work: Work) -> tuple[Work, Array | None]:
    """The work of a motor that gives a work on the crank, at constant speed, and what the transmission loses."""
    gear = motor.transmission
    there, back = (gear.speed_ratio() / gear.torque_ratio(jnp.asarray(way)) for way in (True, False))
    shaft = Work(work.supplied * there, work.absorbed * back)
    return shaft, shaft.net - work.net if gear.loses else None


@compiled_soon
def _with_rotor(
    motor: MotorDrive, half: Array, slope: Array, shares: tuple[Array, ...], nominal: Array, rotor: Array, net: Array
) -> Work:
    """The work of a motor whose rotor follows a motion law: it does no net work, but the motor has to accelerate it."""
    torque, gear = _on_crank(slope, shares, nominal), motor.transmission
    shaft = torque * gear.speed_ratio() / gear.torque_ratio(torque > 0)
    return _split_to(half, shaft + rotor, net)


@compiled_soon
def _by_characteristic(
    motor: MotorDrive, grid: Grid, here: Reduced, at_edges: Array, series: Array, energy: Array, floor: Array,
    constant: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Torque of the motor at the nodes (N m), referred to the crank, and the work that its transmission loses (J)."""
    rotor, by = motor.rotor_inertia(), grid.rule
    work = at_edges[:-1, None] + series @ jnp.asarray(by.at_nodes.T)
    speed = safe_sqrt(2 * (energy + work) / jnp.maximum(here.inertia + rotor, floor))
    on_crank = BySpeed((), motor, rotor, None, ()).rise(here, speed, constant) - here.torque
    shaft = motor.motor_torque(speed) * motor.transmission.speed_ratio()
    return shaft, primitive(grid, shaft - on_crank).at_edges[-1]
