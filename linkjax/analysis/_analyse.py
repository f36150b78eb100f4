"""The complete analysis of a working cycle in one call."""

from __future__ import annotations

import warnings
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import planned
from linkjax._results import Result, merge
from linkjax._types import Tracer, as_float
from linkjax.analysis._cycle import Cycle, explain, explain_start
from linkjax.analysis._friction import friction_runs, known_reduced
from linkjax.analysis._idle import warn_of_idle
from linkjax.analysis._missing import massless, only_what_exists
from linkjax.analysis._precision import FEWEST, fewest_digits
from linkjax.analysis._stages import staged
from linkjax.analysis._wound import warn_of_wound
from linkjax.loads import Passage
from linkjax.machine import ReadyScene, Scene, check_scene, nameless, ready
from linkjax.mechanism import StructureError
from linkjax.motion import speed_dependent
from linkjax.sampling import Ahead, Sampler


def analyse(
    scene: Scene,
    *,
    angles: Any = 360,
    nodes: int = 96,
    constant_speed: bool | None = None,
    method: Literal["quadrature", "diffrax"] = "quadrature",
    throw: bool = True,
) -> Cycle:
    """Analyse a working cycle: kinematics, reduction, actual motion, forces, peaks, flywheel, checks.

    `angles` is a number of uniform crank angles over the cycle or an array of crank angles (rad). `nodes` is the number
    of nodes of the cycle grid per crank turn. With `constant_speed` (default: that of the scene) the crank turns at
    constant nominal speed and the actual motion is not computed. `method` gives the actual motion: by quadrature of the
    energy equation, or by diffrax from the equation of motion; the latter has forward derivatives only (`jax.jvp`), and
    `motion.steady_by_diffrax` takes another adjoint.
    Raises `MachineError` (a ValueError) with group, angle, shortfall and remedy if the linkage cannot be assembled;
    with `throw=False`, and under jax transformations, `result` holds the code instead. If no actual motion exists (no
    inertia, or too low a speed), everything else is computed and `Cycle.missing` gives the reason. Raises
    `StructureError` for diffrax if the driver has a motion law, and ValueError for fewer than 8 nodes.
    """
    check_scene(scene)
    if nodes < 8:
        raise ValueError(f"nodes must be at least 8, but is {nodes}; 96 gives about ten digits")
    scene, angles = jax.tree.map(as_float, scene), _angles(scene, angles)
    if scene.speed.dtype == jnp.float32:
        warnings.warn(
            "linkjax computes in float32: at most about six digits of δ, fewer near singular positions, and checks "
            "near 1e-6; call linkjax.enable_x64() before loading the scene for full precision",
            stacklevel=2,
        )
    if scene.mechanism.prescribed and method == "diffrax":
        problem = "has a motion law: its motion is known, so there is no equation of motion to solve"
        raise StructureError(scene.mechanism.driving_link, problem, "use the quadrature, or delete the law")
    if method == "diffrax" and speed_dependent(scene):
        problem = "its motion depends on torques that depend on the speed (a motor, a damper, drag, friction)"
        raise StructureError("method", problem, "omit method: collocation gives this motion; lj.run gives others")
    if method not in ("quadrature", "diffrax"):
        raise ValueError(f'method must be "quadrature" or "diffrax", but is {method!r}')
    constant_speed = scene.constant_speed if constant_speed is None else constant_speed
    cycle = only_what_exists(_analyse(scene, angles, nodes, constant_speed, method, throw))
    if throw and not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(cycle)):
        explain(cycle)
        warn_of_idle(cycle)
        warn_of_wound(cycle)
    if scene.speed.dtype == jnp.float32 and not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(cycle)):
        left = fewest_digits(cycle)
        if left < FEWEST:
            warnings.warn(
                f"float32 gives this machine about {max(left, 0.0):.1f} digits, by its margins and checks; call "
                "linkjax.enable_x64() before loading the scene",
                stacklevel=2,
            )
    return cycle


analyze = analyse


def compile_ahead(scene: Scene, *, angles: Any = 360, nodes: int = 96, method: str = "quadrature") -> None:
    """Start compiling what `analyse` needs for scenes of this topology, in other threads."""
    scene = nameless(jax.tree.map(as_float, scene))[0]
    _ahead(ready(scene), _angles(scene, angles), nodes, method, _moves(scene, scene.constant_speed))


def _angles(scene: Scene, angles: Any) -> Array:
    """The crank angles (rad): uniform ones from their number, or those of an array."""
    if isinstance(angles, int | np.integer) and not isinstance(angles, bool):
        if angles < 1:
            raise ValueError(f"angles must be at least 1, but is {angles}; 360 gives whole degrees")
        return jnp.arange(int(angles), dtype=float) * (scene.cycle / int(angles))
    found = jnp.asarray(angles, dtype=float)
    if found.ndim != 1 or found.size == 0:
        raise ValueError(
            f"angles must be an integer or a list of crank angles in rad, but has the shape {found.shape}; "
            "write e.g. angles=360 or angles=jnp.linspace(0, 1, 50)"
        )
    return found


def _analyse(scene: Scene, angles: Array, nodes: int, constant_speed: bool, method: str, throw: bool) -> Cycle:
    """The analysis in stages. The actual motion is omitted at constant speed, and if nothing has a mass."""
    plain, names = nameless(scene)
    made, moves = ready(plain), _moves(scene, constant_speed)
    if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((made, angles))):
        if throw:
            explain_start(made.of(scene))
        _ahead(made, angles, nodes, method, moves)
    found = staged(Sampler(made), angles, nodes, method, moves)
    shown, motion, still = found.shown, found.motion, not constant_speed and found.motion is None
    runs = friction_runs(made.scene, shown.friction, found.rubs)
    locked = [run.locks for run in runs[:1] if run is not None and (constant_speed or made.scene.mechanism.prescribed)]
    locked = [jnp.where(each & (found.code != Result.CANNOT_BE_ASSEMBLED), Result.LOCKED, 0) for each in locked]
    results = {
        "friction": None if still else runs[-1 if constant_speed else 0], "friction_constant_speed": runs[-1],
        "pose": shown.pose, "transmission": shown.transmission, "transmission_ends": found.spans,
        "margins": found.limits, "dead_centres": found.dead, "strokes": found.covered,
        "reduced": known_reduced(shown, motion), "steady": motion, "speed": shown.speed[0] if moves else None,
        "acceleration": shown.acceleration[0] if moves else None, "time": shown.time,
        "forces": None if still else shown.forces[-1 if constant_speed else 0],
        "forces_constant_speed": shown.forces[-1], "peaks": found.peaks[0] if moves else None,
        "peaks_constant_speed": found.peaks[-1], "rms_shaking_force_constant_speed": found.rms,
        "flywheel": found.wheels, "motor": found.motor, "work": found.work, "checks": found.checks,
        "assembled": shown.assembled, "on_grid": found.on_grid,
        "windows": dict(zip(_passages(made.scene), found.grid.passages, strict=True)),
        "result": merge(found.code, jnp.where(still, Result.NO_INERTIA, 0), *locked), "nodes": found.grid.size,
    }  # fmt: skip
    results = results if names is None else names.back(results)
    return Cycle(scene=scene, angles=angles, constant_speed=constant_speed, method=method, **results)


def _passages(scene: Scene) -> list[str]:
    """The loads whose window is given by what happens."""
    return [load.name for load in scene.loads if isinstance(load.window, Passage)]


def _ahead(made: ReadyScene, angles: Array, nodes: int, method: str, moves: bool) -> None:
    """Start compiling all stages at once, each from the shapes of the results before."""
    leaves, tree = jax.tree.flatten(made)
    if not planned((tree, tuple((leaf.shape, leaf.dtype) for leaf in leaves), angles.size, nodes, method, moves)):
        staged(Ahead(made), angles, nodes, method, moves)


def _moves(scene: Scene, constant_speed: bool) -> bool:
    """Whether the actual motion is computed: always with a motion law, otherwise unless the speed is constant, or
    nothing has a mass and no flywheel is required."""
    lifeless = massless(scene) and scene.target_delta is None
    return scene.mechanism.prescribed or not (constant_speed or lifeless)
