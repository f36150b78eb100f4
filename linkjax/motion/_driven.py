"""The steady-state motion under torques that depend on the speed: a motor, dampers, resistances."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import taken
from linkjax.kinematics import Pose
from linkjax.machine import Scene
from linkjax.motion._by_speed import BySpeed, Driven, moving_at, torques_of
from linkjax.motion._collocation import Orbit, Panels, gained, periodic, seek
from linkjax.motion._flow import LEAST, Begun, Duty, Flow, duty_of, inertia_floor, primitive, spotted
from linkjax.motion._grid import Grid
from linkjax.motion._nodes import AtEdges, AtNodes
from linkjax.reduction import Moving, Reduced, by_speed
from linkjax.sampling import Sampler

STARTS = np.geomspace(0.02, 4.0, 33)  # speeds, relative to the nominal one, from which a motor's cycle is followed
SOLVED = 1e-8  # relative: what may be left of the equations


class Given(NamedTuple):
    """What holds at all nodes: torques that depend on the speed, the least kinetic energy (J), and the wanted mean of
    the time per crank angle (s/rad)."""

    torques: BySpeed
    least: Array
    pace: Array


class Nodes(NamedTuple):
    """The machine at the nodes: the reduced model without the loads that depend on the speed, what these need, and the
    reduced inertia with the rotor (kg m²), above zero."""

    here: Reduced
    moving: Moving | None
    inertia: Array


def _rate(given: Given, at: Nodes, energy: Array) -> Array:
    speed = _speed(given, at, energy)
    torques = given.torques
    return torques.rise(torques.loaded(at.here, at.moving, speed), speed, jnp.zeros_like(energy))


def _speed(given: Given, at: Nodes, energy: Array) -> Array:
    return jnp.sqrt(2 * jnp.maximum(energy, given.least) / at.inertia)


def _lack(panels: Panels, energy: Array) -> Array:
    """The mean time per crank angle relative to the wanted one, minus one."""
    slowness = 1 / _speed(panels.given, panels.data, energy)
    return jnp.sum(panels.weights * slowness) / (jnp.sum(panels.weights) * panels.given.pace) - 1


def begun_by_speed(
    machine: Sampler, grid: Grid, at: AtNodes, added: Any = 0.0, ratio: Any = 1.0
) -> tuple[Begun, AtEdges | None]:
    """The motion from the values at the nodes; and the edges, if known. `added` is a flywheel inertia (kg m²) that the
    machine does not have; without a motor the time mean of the speed is the wanted one times `ratio`."""
    pose = at.sample.pose if by_speed(machine.scene) else None
    numbers = (jnp.asarray(each, float) if isinstance(each, int | float) else each for each in (added, ratio))
    given = (duty_of(machine.scene), machine.scene, grid, at.here, at.sample.dynamics, pose, *numbers)
    return machine.run(_begun, *given, edges=at.edges is not None)


class Solved(NamedTuple):
    """A periodic solution, or the nearest motion; whether it was found, the number of stable ones, and the gain of
    energy (J) over the cycle."""

    orbit: Orbit
    found: Array
    number: Array
    gain: Array


def _solved(panels: Panels, speed: Array) -> Solved:
    fixed, none = jax.lax.stop_gradient(panels), jnp.zeros_like(speed)
    nominal = 0.5 * fixed.data.inertia * jax.lax.stop_gradient(speed) ** 2
    if panels.given.torques.motor is None:
        constant = -jnp.sum(fixed.weights * fixed.slopes(_rate, nominal)) / jnp.sum(fixed.weights)
        orbit = periodic(_rate, panels, nominal, nominal[:, 0], constant, _lack)
        return Solved(orbit, orbit.left < SOLVED, jnp.ones((), int), none)
    first = nominal[0, 0]
    found = seek(_rate, fixed, first * jnp.asarray(STARTS) ** 2, first)
    nodes, edges = (jnp.maximum(part, fixed.given.least) for part in (found.passed.nodes, found.passed.edges))
    nearest = Orbit(nodes, edges, none, found.passed.slope, none)
    orbit = periodic(_rate, panels, nodes, edges, none, None)
    good = found.found & (orbit.left < SOLVED)
    orbit = jax.tree.map(lambda a, b: jnp.where(good, a, b), orbit, nearest)
    return Solved(orbit, good, found.number, gained(_rate, panels, nodes, edges))


@compiled_soon(static=("edges",))
def _begun(
    duty: Duty, scene: Scene, grid: Grid, here: Reduced, dynamics: tuple, pose: Pose | None, added: Array,
    ratio: Array, edges: bool,
) -> tuple[Begun, AtEdges | None]:  # fmt: skip
    torques, weights = torques_of(scene), grid.half[:, None] * grid.rule.w[None]
    here = here._replace(inertia=here.inertia + added)
    total = here.inertia + torques.rotor
    inertia = jnp.maximum(total, inertia_floor(jnp.sum(weights * total) / duty.cycle))
    unit = 0.5 * duty.speed**2 * jnp.sum(weights * inertia) / duty.cycle
    moving = moving_at_nodes(grid, torques, pose)
    given = Given(torques, LEAST * LEAST * unit, 1 / (duty.speed * ratio))
    panels = Panels(grid.half, given, Nodes(here, moving, inertia), unit, grid.n)
    orbit, found, number, gain = _solved(panels, duty.speed)
    rise = panels.slopes(_rate, orbit.nodes) + orbit.constant
    full = torques.loaded(here, moving, _speed(panels.given, panels.data, orbit.nodes))
    mean = -jnp.sum(weights * full.torque) / duty.cycle
    driven = Driven(torques, orbit.constant, mean, orbit.multiplier, found, number, gain)
    inside = full._replace(inertia=total, torque=rise)
    flow = Flow.of(duty, grid, inside, primitive(grid, rise), jnp.zeros_like(mean), added + torques.rotor, driven)
    energy = orbit.edges[0]
    clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, flow.inertia))
    ends = _edges(grid, flow, driven, dynamics, pose, added, orbit.edges) if edges else None
    return Begun(flow, energy, clock, *spotted(flow, energy)), ends


def moving_at_nodes(grid: Grid, torques: BySpeed, pose: Pose | None) -> Moving | None:
    """What loads that depend on the speed need at the nodes, whose pose comes first in `pose`."""
    if pose is None:
        return None
    shape = grid.nodes.shape
    own = jax.tree.map(lambda leaf: leaf[: grid.size].reshape((*shape, *leaf.shape[1:])), pose)
    panel = jnp.broadcast_to(jnp.arange(grid.panels, dtype=jnp.int32)[:, None], shape)
    found = moving_at(torques.numbers, grid, own, grid.nodes, panel)
    return None if found is None else found._replace(active=taken(grid.order, panel))


def _edges(
    grid: Grid, flow: Flow, driven: Driven, dynamics: tuple, pose: Pose | None, added: Array, energy: Array
) -> AtEdges:
    """Inertia and torques at every panel's first edge, with the energies (J) there."""
    number = jnp.arange(grid.panels, dtype=jnp.int32)
    rest, there = jax.tree.map(lambda leaf: leaf[grid.size : grid.size + grid.panels], (dynamics, pose))
    sides = []
    for panel in (number, jnp.roll(number, 1)):
        here = grid.reduced(rest, panel)
        here = here._replace(inertia=here.inertia + added)
        inertia = jnp.maximum(here.inertia + driven.torques.rotor, flow.floor)
        moving = moving_at(driven.torques.numbers, grid, there, grid.edges[:-1], panel) if there is not None else None
        sides.append(driven.rise(here, moving, flow.speed(energy, inertia)))
    return AtEdges(here.inertia - added, *sides)
