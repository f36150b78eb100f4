"""Steady-state motion for a constant balancing drive torque, by quadrature of the energy equation.

With torques that depend only on position, ½ J ω² = E₀ + W(φ) with W = ∫ (Q + T) dφ, so there is no differential
equation to solve. W is smooth between breakpoints and is interpolated; J is computed exactly wherever a speed is
needed.
Source: energy equation of a machine, Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 16.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._numerics import safe_sqrt, wrapped
from linkjax._tree import node
from linkjax._types import Scalar
from linkjax.kinematics import Pose, pose
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion._by_speed import Driven, moving_at, near_by, on_pose, speed_dependent, torques_of, whole
from linkjax.motion._driven import moving_at_nodes
from linkjax.motion._error import delta_error
from linkjax.motion._flow import LEAST, Begun, Duty, Ends, Flow, Primitive, Spots, duty_of, primitive, spotted
from linkjax.motion._grid import Grid, Place
from linkjax.motion._nodes import AtEdges, AtNodes, at_nodes, reduced_in
from linkjax.motion._speed_extremes import driven_on, speed_extremes
from linkjax.motion._switching import grid_with_kinks
from linkjax.reduction import Moving, Reduced, of_crank
from linkjax.sampling import Sampler


@node
class Steady:
    """Steady-state motion. Speeds in rad/s, angles in rad, torque in N m, energies in J, period in s.

    `delta_error` bounds the absolute error of `delta`, the coefficient of speed fluctuation (None where it was not
    asked for). `steady_state_margin` is the least kinetic energy divided by ½ J̄ ω_m², minus the least value of a
    steady-state motion (1e-6): if it is negative, no steady-state motion exists at this mean speed, and
    `min_mean_speed` is the lowest mean speed that has one. `min_inertia_ratio` is the least reduced inertia divided by
    its mean. Where the reduced inertia is zero the speed is unbounded, and the values are those of a machine with
    `inertia_floor` (kg m²) there. `excess_work` is the largest excess work, max W - min W, at the mean torque of
    the drive.
    """

    work: Primitive
    clock: Primitive
    energy: Array
    mean_drive_torque: Array
    period: Array
    mean_speed: Array
    delta: Array
    delta_error: Any
    max_speed: Array
    min_speed: Array
    angle_of_max: Array
    angle_of_min: Array
    steady_state_margin: Array
    angle_of_min_work: Array
    min_mean_speed: Array
    min_inertia_ratio: Array
    angle_of_min_inertia: Array
    inertia_floor: Array
    excess_work: Array
    driven: Driven | None
    evaluations: int | None = eqx.field(static=True)

    @property
    def grid(self) -> Grid:
        """The cycle grid."""
        return self.work.grid

    @property
    def rotor(self) -> Array | float:
        """Inertia of the motor's rotor on the crank (kg m²), which the reduced inertia of the machine lacks."""
        return 0.0 if self.driven is None else self.driven.torques.rotor

    def inertia(self, bare: Array) -> Array:
        """The reduced inertia that moves (kg m²), with the rotor and above zero, from that of the machine."""
        return jnp.maximum(bare if self.driven is None else bare + self.rotor, self.inertia_floor)

    def reference(self, nominal: Scalar) -> Any:
        """The mean speed to which δ is relative (rad/s): the one found where torques depend on the speed."""
        return nominal if self.driven is None else self.mean_speed

    def drive_torque(self, here: Reduced) -> Array:
        """Torque of the drive at the nodes (N m), shape (panels, n), with the reduced model there of all loads: that on
        the crank, before it accelerates the rotor of a motor."""
        if self.driven is None:
            return jnp.broadcast_to(self.mean_drive_torque, here.torque.shape)
        rise = self.driven.torques.rise(here, self.node_speeds(here.inertia), self.driven.constant)
        return rise - here.torque

    def node_speeds(self, bare: Array) -> Array:
        """Crank speed at the nodes (rad/s), shape (panels, n), from the reduced inertia of the machine there."""
        work = self.work.at(self.grid.node_places())
        return safe_sqrt(2 * (self.energy + work) / self.inertia(bare))

    def at(self, scene: Scene | ReadyScene, place: Place) -> tuple[Array, Array]:
        """Crank speed (rad/s) and acceleration (rad/s²) of a scene at one place of the grid."""
        made = ready(scene)
        grid, at = self.grid, pose(made.mechanism, place.phi)
        here = reduced_in(made, grid, place.phi, place.panel, at)
        moving = moving_at(torques_of(made), grid, at, place.phi, place.panel)
        return self.crank(made.scene.speed, here, place, moving)

    def crank(self, nominal: Scalar, here: Reduced, place: Place, moving: Moving | None = None) -> tuple[Array, Array]:
        """Crank speed (rad/s) and acceleration (rad/s²) at places of the grid, with the reduced model there, what loads
        that depend on the speed need there, and the `nominal` speed (rad/s)."""
        if self.grid.prescribed:
            return nominal * jnp.ones_like(place.phi), jnp.zeros_like(place.phi)
        inertia = self.inertia(here.inertia)
        floor = LEAST * 0.5 * inertia * nominal**2
        speed = jnp.sqrt(2 * jnp.maximum(self.energy + self.work.at(place), floor) / inertia)
        if self.driven is not None:
            moving = near_by(moving, self.grid, self.driven.near, place.panel, place.x)
            rise = self.driven.rise(here, moving, speed)
            return speed, (rise - 0.5 * here.slope * speed**2) / inertia
        return speed, (here.torque + self.mean_drive_torque - 0.5 * here.slope * speed**2) / inertia


def steady_motion(scene: Scene | ReadyScene, nodes: int = 96) -> Steady:
    """Steady-state motion of a scene, with about `nodes` nodes per crank turn on the cycle grid.

    Never raises: if no steady-state motion exists, `steady_state_margin` is negative and every value is finite.
    """
    machine = Sampler(ready(scene))
    grid = grid_with_kinks(machine, nodes, still=False)
    return steady_on(machine, grid, at_nodes(machine, grid))


def steady_on(machine: Sampler, grid: Grid, at: AtNodes) -> Steady:
    """Steady-state motion from the node values; see `steady_motion`."""
    if speed_dependent(machine.scene):
        return conclude(machine, *driven_on(machine, grid, at))
    here = all_loads(machine, grid, at, None) if grid.prescribed else at.here
    begun = machine.run(begin, duty_of(machine.scene), grid, here, 0.0)
    return conclude(machine, begun, at.edges)


def all_loads(machine: Sampler, grid: Grid, at: AtNodes, steady: Steady | None) -> Reduced:
    """The reduced model at the nodes with all loads: those that depend on the speed at that of the actual motion, or at
    the nominal speed without one."""
    if not on_pose(machine.scene):
        return at.here
    return machine.run(_all_loads, whole(machine), grid, at.here, at.sample.pose, steady)


@compiled_soon
def _all_loads(
    made: Scene | ReadyScene, grid: Grid, here: Reduced, pose: Pose, steady: Steady | None
) -> Reduced:  # fmt: skip
    scene = made.scene if isinstance(made, ReadyScene) else made
    torques, speed, constant = torques_of(made), scene.speed * jnp.ones_like(grid.nodes), None
    if steady is not None and steady.driven is not None:
        speed, constant = steady.node_speeds(here.inertia), steady.driven.constant
    full = torques.loaded(here, moving_at_nodes(grid, torques, pose), speed, constant)
    return of_crank(full, grid.prescribed)  # a motion law moves the crank whatever resists


def _excess_of_loads(flow: Flow) -> Array:
    """The largest excess work (J) of all loads, with a constant torque instead of that of the motor."""
    torque = sum(flow.here.by_load.values(), jnp.zeros_like(flow.here.torque))
    mean = jnp.sum(flow.weights * torque) / flow.duty.cycle
    (most, least), _ = primitive(flow.grid, torque - mean).extremes()
    return most - least


def conclude(machine: Sampler, begun: Begun, edges: AtEdges | None) -> Steady:
    """The motion that follows from the work over the cycle and the energy constant for the wanted time mean."""
    flow, energy, clock, spots, place = begun
    ends, light = speed_extremes(machine, flow, energy, spots, place)
    if machine.scene.mean == "time" or flow.driven is not None:
        return machine.run(_concluded, flow, energy, clock, ends, light, spots, None, edges, rounds=1)
    for _ in range(2):  # energy and extremes depend on each other: quadratic convergence
        energy, spots, place = machine.run(_midrange, flow, energy, ends)
        ends, light = speed_extremes(machine, flow, energy, spots, place)
    slow, _ = speed_extremes(machine, flow, *machine.run(_least, flow))
    return machine.run(_concluded, flow, energy, clock, ends, light, spots, slow, edges, rounds=4)


def fluctuation(machine: Sampler, begun: Begun) -> Any:
    """δ alone."""
    if machine.scene.mean != "time" and begun.flow.driven is None:
        return conclude(machine, begun, None).delta
    flow, energy, _, spots, place = begun
    return machine.run(_fluctuation, flow, energy, speed_extremes(machine, flow, energy, spots, place)[0])


@compiled_soon
def begin(duty: Duty, grid: Grid, here: Reduced, added: Scalar) -> Begun:
    """`added` is a flywheel inertia (kg m²) that the machine does not have."""
    here = here._replace(inertia=here.inertia + added)
    drive = -jnp.sum(grid.half[:, None] * grid.rule.w[None] * here.torque) / duty.cycle
    flow = Flow.of(duty, grid, here, primitive(grid, here.torque + drive), drive, added)
    energy = flow.energy_for_time_mean()
    clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, here.inertia))
    return Begun(flow, energy, clock, *spotted(flow, energy))


@compiled_soon
def _fluctuation(flow: Flow, energy: Array, ends: Ends) -> Array:
    fastest, slowest = flow.speeds(ends)
    if flow.driven is None:
        return (fastest - slowest) / flow.duty.speed
    time = flow.duty.cycle / flow.period(energy)
    return (fastest - slowest) / (time if flow.duty.mean == "time" else 0.5 * (fastest + slowest))


@compiled_soon
def _midrange(flow: Flow, energy: Array, ends: Ends) -> tuple[Array, Spots, Place]:
    energy = flow.energy_for_midrange(energy, ends)
    return energy, *spotted(flow, energy)


@compiled_soon
def _least(flow: Flow) -> tuple[Array, Spots, Place]:
    """The energy with which the crank only just rotates fully."""
    energy = flow.least_energy()
    return energy, *spotted(flow, energy)


@compiled_soon(static=("rounds",))
def _concluded(
    flow: Flow, energy: Array, clock: Primitive, ends: Ends, light: tuple[Array, Array], spots: Spots,
    slow: Ends | None, edges: AtEdges | None, rounds: int,
) -> Steady:  # fmt: skip
    """The motion; `slow` are the extremes at the lowest mean speed where it is the mean of the extremes."""
    duty, grid = flow.duty, flow.grid
    if duty.mean == "midrange" and flow.driven is None:
        new = flow.energy_for_midrange(energy, ends)
        ends, energy = ends._replace(height=ends.height + (new - energy) / ends.inertia), new
        clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, flow.inertia))
    fastest, slowest = flow.speeds(ends)
    error = None if edges is None else delta_error(flow, energy, ends, edges, spots)
    period = flow.period(energy)
    mean = duty.cycle / period if duty.mean == "time" else 0.5 * (fastest + slowest)
    (most, least), angle = flow.work.extremes()
    bare = LEAST * flow.scale - least  # the energy with which the crank only just rotates fully
    lowest = duty.cycle / flow.period(bare) if slow is None else 0.5 * jnp.sum(flow.speeds(slow))
    top, bottom = wrapped(ends.place.phi, duty.cycle)
    drive = flow.drive
    if duty.prescribed:  # inertia does no net work over a cycle
        shares = sum(flow.here.by_load.values(), jnp.zeros_like(flow.here.torque))
        drive = -jnp.sum(flow.weights * shares) / duty.cycle
        error = None if error is None else jnp.zeros_like(drive)
    margin, unit, excess = (energy + least) / flow.scale - LEAST, duty.speed, most - least
    if flow.driven is not None:
        excess = _excess_of_loads(flow)
        drive, lowest, unit = flow.driven.mean_torque, jnp.zeros_like(period), mean
        margin = jnp.where(flow.driven.found, margin, -jnp.abs(flow.driven.gain) / flow.scale - LEAST)
    return Steady(
        flow.work, clock, energy, drive, period, mean, (fastest - slowest) / unit,
        None if error is None else jax.lax.stop_gradient(error), fastest, slowest, top, bottom,
        margin, wrapped(angle[1], duty.cycle), lowest,
        light[0], wrapped(light[1], duty.cycle), flow.floor, excess, flow.driven,
        grid.evaluations + grid.size + 8 * rounds + grid.half.size + 2,
    )  # fmt: skip
