"""Steady-state motion for a constant balancing drive torque, by quadrature of the energy equation.

With torques that depend only on position, ½ J ω² = E₀ + W(φ) with W = ∫ (Q + T) dφ, so there is no differential
equation to solve. W is smooth between breakpoints and is interpolated; J is computed exactly wherever a speed is
needed.
Source: energy equation of a machine, Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 16.
"""

from __future__ import annotations

import contextlib
import contextvars
from collections.abc import Iterator

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import once, wrapped
from linkjax.kinematics import Pose, pose
from linkjax.loads import Instant
from linkjax.machine import Scene, ready
from linkjax.motion._error import delta_error
from linkjax.motion._flow import LEAST, Flow, Primitive, primitive
from linkjax.motion._grid import Grid, Place, make_grid
from linkjax.reduction import Reduced, governing, reduce_pose, reduced_model

_WATCHED: contextvars.ContextVar[list[Scene] | None] = contextvars.ContextVar("watched", default=None)


@contextlib.contextmanager
def watched() -> Iterator[list[Scene]]:
    """The scenes whose actual motion is requested inside the context; under `jax.jit`, while it is traced."""
    seen: list[Scene] = []
    token = _WATCHED.set(seen)
    try:
        yield seen
    finally:
        _WATCHED.reset(token)


def asked_for(scene: Scene) -> None:
    """Record for `watched` that the actual motion of this scene is requested."""
    seen = _WATCHED.get()
    if seen is not None:
        seen.append(scene)


class Steady(eqx.Module):
    """Steady-state motion. Speeds in rad/s, angles in rad, torque in N m, energies in J, period in s.

    `delta_error` bounds the absolute error of `delta`, the coefficient of speed fluctuation. `steady_state_margin` is
    the least kinetic energy divided by ½ J̄ ω_m², minus the least value of a steady-state motion (1e-6): if it is
    negative, no steady-state motion exists at this mean speed, and `min_mean_speed` is the lowest mean speed that has
    one. `min_inertia_ratio` is the least reduced inertia divided by its mean. Where the reduced inertia is zero the
    speed is unbounded, and the values are those of a machine with `inertia_floor` (kg m²) there.
    """

    work: Primitive
    clock: Primitive
    energy: Array
    mean_drive_torque: Array
    period: Array
    mean_speed: Array
    delta: Array
    delta_error: Array
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
    evaluations: int | None = eqx.field(static=True)

    @property
    def grid(self) -> Grid:
        """The cycle grid."""
        return self.work.grid

    def at(self, scene: Scene, place: Place) -> tuple[Array, Array]:
        """Crank speed (rad/s) and acceleration (rad/s²) at a place of the grid."""
        if scene.mechanism.prescribed:
            return scene.speed * jnp.ones_like(place.phi), jnp.zeros_like(place.phi)
        here = reduced_model(scene, place.phi, self.grid.middle[place.panel])
        here = here._replace(inertia=jnp.maximum(here.inertia, self.inertia_floor))
        floor = LEAST * 0.5 * here.inertia * scene.speed**2
        speed = jnp.sqrt(2 * jnp.maximum(self.energy + self.work.at(place), floor) / here.inertia)
        return speed, (here.torque + self.mean_drive_torque - 0.5 * here.slope * speed**2) / here.inertia


def steady_motion(scene: Scene, nodes: int = 96) -> Steady:
    """Steady-state motion of a scene, with about `nodes` nodes per crank turn on the cycle grid.

    Never raises: if no steady-state motion exists, `steady_state_margin` is negative and every value is finite.
    """
    asked_for(scene)
    scene = ready(scene)
    grid = make_grid(scene, nodes)
    return steady_on(scene, grid, node_values(scene, grid))


def node_poses(scene: Scene, grid: Grid) -> Pose:
    """The pose at every node, leaves of shape (panels * n,)."""
    return jax.vmap(lambda phi: pose(scene.mechanism, phi))(grid.nodes.ravel())


def node_values(scene: Scene, grid: Grid, poses: Pose | None = None) -> Reduced:
    """Reduced inertia, slope and torque at every node, shape (panels, n); `poses` from `node_poses` if known."""
    sides = jnp.broadcast_to(grid.orders(scene)[:, None], grid.nodes.shape).ravel()
    scene = grid.in_order(scene)

    def at(phi, side, here):
        return governing(scene, reduce_pose(scene, Instant(phi, side, scene.cycle), here))

    flat = jax.vmap(at)(grid.nodes.ravel(), sides, node_poses(scene, grid) if poses is None else poses)
    flat = flat._replace(inertia=once(flat.inertia), slope=once(flat.slope), torque=once(flat.torque))
    return jax.tree.map(lambda leaf: leaf.reshape(grid.nodes.shape), flat)


@jax.jit  # traced once, however often a flywheel search calls it
def steady_on(scene: Scene, grid: Grid, here: Reduced) -> Steady:
    """Steady-state motion from the node values; see `steady_motion`."""
    drive = -jnp.sum(grid.half[:, None] * grid.rule.w[None] * here.torque) / scene.cycle
    flow = Flow(scene, grid, here, primitive(grid, here.torque + drive), drive)
    energy = flow.energy_for_time_mean()
    clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, here.inertia))
    found = conclude(flow, energy, clock)
    if not scene.mechanism.prescribed:
        return found
    shares = sum(here.by_load.values(), jnp.zeros_like(here.torque))
    mean = -jnp.sum(flow.weights * shares) / scene.cycle  # inertia does no net work over a cycle
    return eqx.tree_at(lambda s: (s.mean_drive_torque, s.delta_error), found, (mean, jnp.zeros_like(mean)))


def conclude(flow: Flow, energy: Array, clock: Primitive) -> Steady:
    """The motion that follows from the work over the cycle and the energy constant for the wanted time mean."""
    scene, grid = flow.scene, flow.grid
    ends, rounds = flow.extremes(energy), 1
    if scene.mean == "midrange":  # energy and extremes depend on each other: quadratic convergence
        for _ in range(2):
            energy, rounds = flow.energy_for_midrange(energy, ends), rounds + 1
            ends = flow.extremes(energy)
        before, energy = energy, flow.energy_for_midrange(energy, ends)
        high, low = (end._replace(height=end.height + (energy - before) / end.inertia) for end in ends)
        ends = high, low
        clock = primitive(grid, 1 / flow.speed(energy + flow.at_nodes, flow.inertia))
    fastest, slowest = (flow.speed(e.height * e.inertia, e.inertia) for e in ends)
    error = delta_error(flow, energy, ends)
    period = flow.period(energy)
    mean = scene.cycle / period if scene.mean == "time" else 0.5 * (fastest + slowest)
    (least, angle), (light, lightest) = flow.work.extreme(-1), flow.min_inertia_ratio()
    bare = LEAST * flow.scale - least  # the energy with which the crank only just rotates fully
    lowest = scene.cycle / flow.period(bare)
    if scene.mean == "midrange":
        high, low = (flow.speed(e.height * e.inertia, e.inertia) for e in flow.extremes(bare))
        lowest, rounds = 0.5 * (high + low), rounds + 1
    top, bottom = (wrapped(end.place.phi, scene.cycle) for end in ends)
    return Steady(
        flow.work, clock, energy, flow.drive, period, mean, (fastest - slowest) / scene.speed,
        jax.lax.stop_gradient(error), fastest, slowest, top, bottom,
        (energy + least) / flow.scale - LEAST, wrapped(angle, scene.cycle),
        lowest,
        light, wrapped(lightest, scene.cycle), flow.floor,
        grid.evaluations + grid.size + 8 * rounds + grid.half.size + 2,
    )  # fmt: skip
