"""The general method: diffrax integrates the equation of motion J φ'' + ½ J' φ'² = Q + T over angle or time.

Over angle, the square of the speed obeys a linear equation, d(ω²)/dφ = (2 (Q + T) - J' ω²) / J, and loads switch at
known angles. Every panel of the cycle grid is mapped to an interval of length one, so derivatives are also right across
a switch. Integration over time makes no assumption. Both start from any state. This method is slower than quadrature
(milliseconds per cycle), but it needs no periodicity, and it checks the quadrature independently. Internally, speeds
are relative to the scene's speed, so that a tolerance means the same for every machine.
diffrax is imported where it is used, because it takes as long to load as jax itself.

Neither forward nor reverse differentiation through an integrator includes the movement of a switch, of the start or of
the output points; measured, the two differed by 1e-4. The remaining movement therefore enters as the rate of the state.
Source: Kidger, On Neural Differential Equations, 2021 (diffrax); equation of motion as in `linkjax.reduction`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from linkjax._numerics import safe_divide, safe_sqrt
from linkjax._types import Scalar
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.mechanism import StructureError
from linkjax.motion._by_speed import speed_dependent
from linkjax.motion._flow import LEAST, Begun, Flow, Primitive, duty_of, spotted
from linkjax.motion._grid import Grid, grid_of, make_grid
from linkjax.motion._nodes import at_nodes, reduced_in
from linkjax.motion._steady import Steady, conclude, steady_on
from linkjax.motion._stiff import control_for, solver_for
from linkjax.motion._torque import Torque, acceleration_at
from linkjax.sampling import Sampler

MOST_CYCLES = 8  # steps end at the switches of this many cycles after the start; later ones are left to step control
MOST_STEPS = 16**4
SHOTS = 6  # Newton steps for the starting energy


class Run(NamedTuple):
    """A motion from a given state: crank angle (rad), speed (rad/s) and time (s) at the requested points.

    `stalled` is true if the speed fell to zero, at `stall_angle` (rad) and `stall_time` (s), which are otherwise
    infinite. Values after a stall are infinite, and so are values after the solver ran out of steps.
    """

    angle: Float[Array, " points"]
    speed: Float[Array, " points"]
    time: Float[Array, " points"]
    stalled: Bool[Array, ""]
    stall_angle: Float[Array, ""]
    stall_time: Float[Array, ""]


def free(scene: Scene | ReadyScene) -> ReadyScene:
    """The scene, made ready. Raises `StructureError` if its driver has a motion law: there is no equation of motion to
    solve."""
    made = ready(scene)
    if made.scene.mechanism.prescribed:
        problem = "has a motion law: its motion is known, so there is no equation of motion to solve"
        raise StructureError(made.scene.mechanism.driving_link, problem, "use the quadrature, or delete the law")
    return made


def run_in_angle(
    scene: Scene | ReadyScene,
    angles: Float[Array, " points"],
    start_speed: Scalar,
    drive_torque: Scalar | Torque | None = None,
    *,
    tolerance: Scalar | float = 1e-10,
    solver: Any = None,
    adjoint: Any = None,
) -> Run:
    """Motion over increasing crank `angles` (rad), starting at the first with `start_speed` (rad/s, positive).

    The drive is the motor of the scene with its rotor and transmission, or none without a motor. A `drive_torque` (N m)
    on the crank takes its place: a number, or a JAX function of crank angle (rad), speed (rad/s) and acceleration
    (rad/s²); from where no acceleration satisfies the equation of motion with it, the values are infinite.
    `solver` and `adjoint` are diffrax's: by default `Dopri8` (`Kvaerno5` for a stiff drive, see
    `linkjax.motion.is_stiff`), and its checkpointed reverse mode; `diffrax.ForwardMode()` is for `jvp`. A start from
    rest counts as a stall: use `run_in_time`. Raises `StructureError` if the driver has a motion law.
    """
    made = free(scene)
    solver = solver or solver_for(made, drive_torque)
    scene, grid = made.scene, make_grid(made, 8)
    place = jax.vmap(grid.place)(angles)
    cycles = jnp.round((angles - jax.lax.stop_gradient(place.phi)) / scene.cycle)
    along = cycles * grid.half.size + place.panel.astype(angles.dtype) + 0.5 * (place.x + 1)
    states, stall = _in_angle(made, grid, along, start_speed, drive_torque, tolerance, solver, adjoint)
    unit = jax.lax.stop_gradient(scene.speed)
    turns, panel = jnp.floor(stall.along / grid.half.size), jnp.mod(stall.along, grid.half.size)
    number = jnp.clip(jnp.floor(panel), 0, grid.half.size - 1).astype(jnp.int32)
    stall_angle = turns * scene.cycle + grid.edges[number] + (panel - jnp.floor(panel)) * 2 * grid.half[number]
    where, when = (jnp.where(stall.happened, x, jnp.inf) for x in (stall_angle, stall.time / unit))
    return Run(angles, unit * safe_sqrt(states[:, 0]), states[:, 1] / unit, stall.happened, where, when)


class Stall(NamedTuple):
    """Whether the speed fell to zero, where along the panels, and when (times the scene's speed)."""

    happened: Bool[Array, ""]
    along: Array
    time: Array


def _in_angle(
    made: ReadyScene, grid: Grid, along, start_speed, drive_torque, tolerance, solver=None, adjoint=None,
    shooting: bool = False,
):  # fmt: skip
    """States at positions `along` the panels (panel k of the first cycle is from k to k + 1), and whether the motion
    stalled. Integration ends at a thousandth of the smaller of start and nominal speed; from there the square of the
    speed is extrapolated linearly to zero.

    With Ω the scene's speed and the energy J Ω² at the first position as unit, a state holds ω² / Ω² and Ω t; with
    `shooting` also the derivative of Ω t with respect to the energy at the start, and the work of the loads. diffrax
    integrates to fixed positions; their shift with the design is added afterwards, with the rate of the state.
    """
    import diffrax

    panels, unit = grid.half.size, jax.lax.stop_gradient(made.scene.speed)
    fixed = jax.lax.stop_gradient(along)
    jumps = jnp.floor(fixed[0]) + jnp.arange(1, MOST_CYCLES * panels + 1, dtype=float)

    def at(s):
        panel = jnp.clip(jnp.mod(jnp.floor(s), panels), 0, panels - 1).astype(jnp.int32)
        width = 2 * grid.half[panel]
        return width, grid.edges[panel] + (s - jnp.floor(s)) * width, panel

    least = jax.lax.stop_gradient(LEAST * jnp.minimum((start_speed / unit) ** 2, 1.0))
    first = jax.lax.stop_gradient(reduced_in(made, grid, *at(fixed[0])[1:]).inertia) if shooting else jnp.ones(())

    def rate(s, state, _):
        width, phi, panel = at(s)
        speed = safe_sqrt(jnp.maximum(state[0], least), 1e-100)
        turned = jnp.floor(s / panels) * made.scene.cycle + phi

        def advance(model):
            return acceleration_at(made.scene.motor, model, drive_torque, turned, speed * unit)

        here = reduced_in(made, grid, phi, panel, speed=speed * unit, advance=advance)
        gain = 2 * advance(here) / unit**2
        more = (-first / (here.inertia * speed**3), here.torque / (first * unit**2)) if shooting else ()
        return width * jnp.stack([gain, 1 / speed, *more])

    start = jnp.stack([(start_speed / unit) ** 2, *[jnp.zeros_like(start_speed)] * (3 if shooting else 1)])
    moved = along - fixed
    start = start - jax.lax.stop_gradient(rate(fixed[0], start, None)) * moved[0]
    solver = solver or diffrax.Dopri8()
    control = diffrax.ClipStepSizeController(control_for(solver, tolerance), jump_ts=jax.lax.stop_gradient(jumps))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate), solver, fixed[0], fixed[-1], None, start,
        saveat=diffrax.SaveAt(ts=fixed, t1=True), stepsize_controller=control,
        adjoint=adjoint or diffrax.RecursiveCheckpointAdjoint(),
        event=diffrax.Event(lambda t, y, args, **_: y[0] <= least), max_steps=MOST_STEPS, throw=False,
    )  # fmt: skip
    assert solution.ys is not None
    assert solution.ts is not None
    end = jnp.sum(jnp.isfinite(solution.ts)) - 1  # the index of the final state, after the requested ones
    found, last = solution.ys[:-1], jax.lax.stop_gradient((solution.ts[end], solution.ys[end]))
    there = _running(jnp.where(jnp.arange(along.size) < end, found[:, 0] - least, 0.0))
    states = jax.lax.stop_gradient(jnp.where(there, found, 1.0))
    rates = jax.vmap(lambda s, state: rate(s, state, None))(fixed, states)
    shift = jax.lax.stop_gradient(rates) * moved[:, None]
    place, low = last[0], last[1][0]
    fall = -rate(place, last[1], None)[0]
    # below the least speed the time was integrated with that speed; actually the square of the speed falls linearly
    late = 2 * jnp.sqrt(least) - safe_divide(least - low, jnp.sqrt(least))
    time = last[1][1] + at(place)[0] * safe_divide(late, fall)
    stall = Stall(solution.result == diffrax.RESULTS.event_occurred, place + safe_divide(low, fall), time)
    return jnp.where(there, found + shift, jnp.inf), jax.lax.stop_gradient(stall)


def _running(speed: Float[Array, " points"]) -> Bool[Array, "points 1"]:
    """Which points lie before a stall: the last step may reach past it, and no motion follows it."""
    return jax.lax.cummin(jnp.where((speed > 0) & jnp.isfinite(speed), 1, 0).at[0].set(1))[:, None] == 1


def steady_by_diffrax(
    scene: Scene | ReadyScene,
    nodes: int = 96,
    *,
    tolerance: Scalar | float = 1e-11,
    solver: Any = None,
    adjoint: Any = None,
) -> Steady:
    """The steady-state motion by diffrax: one cycle, integrated from the starting speed that gives the wanted mean.

    The drive torque balances the energy of the cycle; Newton steps find the starting energy. The result equals that of
    `steady_motion` within the tolerance, and exactly where no steady-state motion exists. `delta_error` is the error of
    the quadrature plus the difference between the two methods, and infinite if the integration failed. Evaluations are
    not counted. The tolerance is at least thirty times the rounding unit of the precision in force. Raises
    `StructureError` if the driver has a motion law, and for a motor or loads that depend on the speed. `solver`
    (default `Dopri8`) and `adjoint` are diffrax's; the adjoint sets the direction of differentiation:
    `ForwardMode()` (default) for `jvp`, `RecursiveCheckpointAdjoint()` for `grad`.
    """
    import diffrax

    made = free(scene)
    scene, machine = made.scene, Sampler(made)
    if speed_dependent(scene):
        problem = "this method finds the steady-state motion of a constant drive torque and loads without speed"
        remedy = "use motion.steady_motion, or run_in_angle"
        what = "friction" if scene.friction else "motor" if scene.motor is not None else "loads"
        raise StructureError(what, problem, remedy)
    tolerance = jnp.maximum(tolerance, 30 * jnp.finfo(scene.speed.dtype).eps)
    grid = grid_of(machine, nodes)
    nodes_at = at_nodes(machine, grid)
    here = nodes_at.here
    places = jnp.arange(grid.half.size, dtype=float)[:, None] + 0.5 * (jnp.asarray(grid.rule.x)[None] + 1)
    along = jnp.concatenate([jnp.zeros(1), places.ravel(), jnp.asarray([float(grid.half.size)])])
    adjoint = adjoint or diffrax.ForwardMode()
    inertia = reduced_in(made, grid, grid.edges[0], jnp.zeros((), jnp.int32)).inertia
    pace = jax.lax.stop_gradient(scene.speed)
    unit = jax.lax.stop_gradient(inertia) * pace**2
    wanted = scene.cycle * pace / scene.speed

    def cycle(energy, drive):
        speed = safe_sqrt(2 * energy / inertia, 1e-6 * pace)
        return _in_angle(made, grid, along, speed, drive, tolerance, solver, adjoint, shooting=True)[0]

    drive = -cycle(1e3 * unit, jnp.zeros(()))[-1, 3] * unit / scene.cycle  # too fast to stall: only the work is used

    def newton(energy):
        end = cycle(energy, drive)[-1]
        return energy - unit * jax.lax.stop_gradient(0.5 * end[1] / end[2]) * ((end[1] / wanted) ** 2 - 1)

    energy = jax.lax.stop_gradient(jax.lax.fori_loop(0, SHOTS, lambda _, e: newton(e), 0.5 * unit))
    energy = newton(energy)  # the last step carries the derivative
    states = cycle(energy, drive)
    squared, clock = (states[1:-1, i].reshape(grid.nodes.shape) for i in (0, 1))
    work = _fitted(grid, 0.5 * here.inertia * squared * pace**2 - energy)
    flow = Flow.of(duty_of(scene), grid, here, work, drive)
    begun = Begun(flow, energy, _fitted(grid, clock / pace), *spotted(flow, energy))
    found = conclude(machine, begun, nodes_at.edges)
    # only another method shows the error of the integration; without steady-state motion there is nothing to integrate
    other = steady_on(machine, grid, nodes_at)
    error = other.delta_error + jax.lax.stop_gradient(jnp.abs(found.delta - other.delta))
    found = dataclasses.replace(found, delta_error=error, evaluations=None)
    runs, whole = other.steady_state_margin > 0, jnp.all(jnp.isfinite(states))
    lost = jnp.where(runs & ~whole, jnp.inf, other.delta_error)
    other = dataclasses.replace(other, delta_error=lost, evaluations=None)
    return jax.tree.map(lambda a, b: jnp.where(runs & whole, a, b), found, other)


def _fitted(grid: Grid, values: Float[Array, "panels n"]) -> Primitive:
    """A quantity known at the nodes as a piecewise series."""
    series = values @ jnp.asarray(grid.rule.series.T)
    low, high = (values @ jnp.asarray(end) for end in grid.rule.ends)
    series = jnp.concatenate([series[:, :1] - low[:, None], series[:, 1:], jnp.zeros_like(low)[:, None]], axis=1)
    return Primitive(grid, jnp.concatenate([low, high[-1:]]), series)
