"""The extremes of the speed, refined on the machine itself, and the motion of which their mean is the wanted one."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import taken
from linkjax.kinematics import Pose
from linkjax.motion._collocation import CLOSED
from linkjax.motion._driven import begun_by_speed
from linkjax.motion._extremum import newton
from linkjax.motion._flow import SIGNS, Begun, Ends, Flow, Spots
from linkjax.motion._grid import Grid, Place
from linkjax.motion._nodes import AtEdges, AtNodes
from linkjax.sampling import Sample, Sampler

REPEATS = 5  # of the motion, for a mean of the extremes


class Repeated(NamedTuple):
    """A motion before its extremes are refined, the values at the edges, and the time mean of its speed over the wanted
    mean."""

    begun: Begun
    edges: AtEdges | None
    ratio: Any


def driven_on(machine: Sampler, grid: Grid, at: AtNodes, added: Any = 0.0) -> tuple[Begun, AtEdges | None]:
    """The motion under torques that depend on the speed, before its extremes are refined, and the edges; see
    `begun_by_speed`."""
    return repeated(machine, grid, at, added)[:2]


def repeated(
    machine: Sampler, grid: Grid, at: AtNodes, added: Any = 0.0, start: Any = None, ratio: Any = 1.0,
    repeats: int = REPEATS, small: float = CLOSED,
) -> Repeated:  # fmt: skip
    """The same from a first `ratio`. Where a constant torque gives the mean of the extremes, the time mean for it is
    found by repetition, which converges like powers of the square of δ. For `small` see `begun_by_speed`."""
    begun, edges = begun_by_speed(machine, grid, at, added, ratio, start, small)
    if machine.scene.mean == "time" or machine.scene.motor is not None:
        return Repeated(begun, edges, ratio)
    for _ in range(repeats):
        ends, _ = speed_extremes(machine, begun.flow, begun.energy, begun.spots, begun.place)
        ratio = machine.run(_ratio, begun.flow, begun.energy, ends)
        begun, edges = begun_by_speed(machine, grid, at, added, ratio, None, small)
    return Repeated(begun, edges, ratio)


@compiled_soon
def _ratio(flow: Flow, energy: Array, ends: Ends) -> Array:
    """The time mean of the speed over the mean of its extremes."""
    return flow.duty.cycle / flow.period(energy) / (0.5 * jnp.sum(flow.speeds(ends)))


def speed_extremes(machine: Sampler, flow: Flow, energy: Any, spots: Spots, place: Place) -> tuple[Ends, Any]:
    """The extremes of the speed, and the least reduced inertia with its angle, in two rounds of evaluations."""
    first = machine.sample(place.phi, place.side, fixed=True)
    moved = machine.run(_moved, flow, energy, spots[:3], *_asked(flow, first))
    return machine.run(_ended, flow, energy, moved, *_asked(flow, machine.sample(moved.place.phi, moved.place.side)))


def _asked(flow: Flow, sample: Sample) -> tuple[tuple, Pose | None]:
    """The reduced model of samples, and their pose if loads depend on the speed."""
    return sample.dynamics, sample.pose if flow.driven is not None and flow.driven.torques.placed else None


class Moved(NamedTuple):
    """Bends at the guesses of the extremes, the steps of Newton's method from them, the slopes before, and the new
    places."""

    bend: Array
    move: Array
    tilt: Array
    place: Place


@compiled_soon
def _moved(flow: Flow, energy: Array, spots: tuple[Array, Array, Array], dynamics: tuple, pose: Pose | None) -> Moved:
    fixed, energy = jax.lax.stop_gradient((flow, energy))
    panel, x, bend = spots
    here, moving = fixed.reduced(dynamics, panel), fixed.moving(pose, fixed.grid.at(panel, x))
    slope = fixed.tilt(panel, x, energy, here, moving)[1]
    slope = jnp.concatenate([slope[:-1], (taken(fixed.grid.half, panel) * here.slope)[-1:]])
    move = newton(x, jnp.asarray(SIGNS, x.dtype) * slope, bend)
    move = jnp.concatenate([jax.lax.stop_gradient(move[:-1]), move[-1:]])
    return Moved(bend, move, slope, flow.grid.at(panel, x + move))


@compiled_soon
def _ended(
    flow: Flow, energy: Array, moved: Moved, dynamics: tuple, pose: Pose | None
) -> tuple[Ends, tuple[Array, Array]]:
    """The extremes, and the least reduced inertia with its angle."""
    here, moving = flow.reduced(dynamics, moved.place.panel), flow.moving(pose, moved.place)
    return flow.ends(*moved, energy, here, moving)
