"""What loads, gravity and the drive do over the cycle: forces, powers, and energies by source and sink."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._batches import joined
from linkjax._compile import compiled_soon
from linkjax._numerics import taken
from linkjax._types import as_float
from linkjax.drives import MotorDrive
from linkjax.forces import JointForce, driven_by_joint
from linkjax.kinematics import Pose
from linkjax.machine import ReadyScene, nameless, ready
from linkjax.mechanism import Mechanism
from linkjax.motion import Grid, Place, Work, drive_work, split_work, unnamed
from linkjax.reduction import Reduced
from linkjax.sampling import Sampler


class OnGrid(NamedTuple):
    """The cycle grid, the reduced model with all loads at its nodes, shape (panels, n), and the slope of the reduced
    inertia there (kg m²/rad), nodes first."""

    grid: Grid
    reduced: Reduced
    slope: Any


class LoadRun(eqx.Module):
    """A load over the cycle: its `force`, `fx` and `fy` (N) on its link at its point and a free `moment` (N m), zero
    while it does not act; its `power` (W); and its work per cycle (J), what it has `supplied` to the machine, and what
    it has `absorbed`.

    A load between two links exerts the opposite force on the other one: the force is that on the first, power and work
    are those of both. Gravity has no `force`, since it acts on every link.
    """

    force: JointForce | None
    power: Float[Array, " angles"]
    supplied: Array
    absorbed: Array

    @property
    def energy(self) -> Array:
        """Work on the machine per cycle (J): supplied minus absorbed."""
        return self.supplied - self.absorbed


def energies_of(cycle: Any) -> dict[str, Work] | None:
    """See `Cycle.energies`."""
    run = cycle.friction or cycle.friction_constant_speed
    if cycle.on_grid is None or (run is not None and bool(run.locks)):
        return None
    scene, (grid, here, slope) = cycle.scene, cycle.on_grid
    speed = as_float(scene.speed)
    rotor = _rotor(scene.motor, scene.mechanism, grid.nodes, speed) if driven_by_joint(scene.mechanism) else None
    work, loss = drive_work(scene.motor, grid, cycle.steady, here, slope, speed, rotor)
    found = {"drive" if scene.motor is None else "motor": work}
    if loss is not None:
        found["transmission"] = Work(jnp.zeros_like(loss), loss)
    names = ["gravity", *(load.name for load in scene.loads), *(["friction"] if scene.friction else [])]
    works = split_work(grid.half, tuple(here.by_load[name] for name in names))
    found |= dict(zip(names, works, strict=True))
    if scene.friction:  # it supplies nothing: what is above zero is a rounding error
        found["friction"] = Work(jnp.zeros_like(found["friction"].net), -found["friction"].net)
    return found


@compiled_soon
def _rotor(motor: MotorDrive | None, mechanism: Mechanism, nodes: Array, speed: Array) -> Array | None:
    """Power of a rotor that follows the motion law of a driver, divided by the crank speed (N m)."""
    law = mechanism.driver.follows()
    if motor is None or law is None:
        return None
    _, d, dd = jax.vmap(jax.vmap(law.at))(nodes)
    return motor.rotor_inertia() * d * dd * speed**2


def loads_of(cycle: Any, energies: dict[str, Work] | None) -> dict[str, LoadRun] | None:
    """See `Cycle.loads`."""
    if energies is None:
        return None
    speed = jnp.broadcast_to(as_float(cycle.scene.speed), cycle.angles.shape) if cycle.speed is None else cycle.speed
    forces = _load_forces(cycle, speed)
    names = ["gravity", *(load.name for load in cycle.scene.loads)]
    return {
        name: LoadRun(force, cycle.reduced.by_load[name] * speed, *energies[name])
        for name, force in zip(names, (None, *forces), strict=True)
    }


def load_document(cycle: Any, assembled: bool) -> dict[str, Any]:
    """The parts `loads` and `energies` of the document of a cycle; None where they do not exist."""
    energies = energies_of(cycle) if assembled else None
    runs = loads_of(cycle, energies)
    if energies is None or runs is None:
        return {"loads": None, "energies": None}
    on = {load.name: load for load in cycle.scene.loads}
    loads = {}
    for name, run in runs.items():
        force: Any = {} if run.force is None else run.force._asdict()
        force = {key: np.asarray(force[key]) for key in force if (key == "moment") is not bool(on[name].point)}
        where = {} if run.force is None else {"link": on[name].link, "point": on[name].point or None}
        loads[name] = {**where, **force, "power": np.asarray(run.power)}
    works = {name: {"supplied": float(work.supplied), "absorbed": float(work.absorbed)}
             for name, work in energies.items()}  # fmt: skip
    return {"loads": loads, "energies": works}


def _load_forces(cycle: Any, speed: Any) -> list[JointForce]:
    """The forces of the loads at the crank angles."""
    if not cycle.scene.loads:
        return []
    machine, grid = Sampler(ready(nameless(cycle.scene)[0])), cycle.on_grid.grid
    place = machine.padded(_places(unnamed(grid), cycle.angles))
    pose, given = machine.sample(place.phi, place.side).pose, (machine.whole_design, grid.active)
    found = joined(machine.parts(_forces, given, (place, pose, *machine.padded((speed,)))))
    return list(machine.cut(found, cycle.angles))


@compiled_soon
def _places(grid: Grid, angles: Array) -> Place:
    return jax.vmap(grid.place)(angles)


@compiled_soon
def _forces(made: ReadyScene, active: Array, place: Place, pose: Pose, speed: Array) -> tuple[JointForce, ...]:
    def at(place, here, speed):
        found = []
        for load, on in zip(made.scene.loads, taken(active, place.panel), strict=True):
            every = load.wrenches(here, made.instant(place.phi, place.side, speed))
            own = [each for each in every if each.link == load.link and each.point in (None, load.point)]
            parts = zip(*((each.force.x, each.force.y, each.couple) for each in own), strict=True)
            found.append(JointForce(*(on * sum(part) for part in parts)))
        return tuple(found)

    return jax.vmap(at)(place, pose, speed)
