"""A scene: a mechanism with its loads, gravity and speed."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._tree import node
from linkjax._types import as_float, known, not_finite
from linkjax._units import nearest
from linkjax._vec import Vec
from linkjax.drives import MotorDrive, Servo
from linkjax.friction import AbstractFriction, check_friction
from linkjax.groups import Path
from linkjax.kinematics import Prepared, prepared
from linkjax.loads import AbstractLoad, Instant, Passage
from linkjax.machine._ends import ends_of
from linkjax.machine._loads import check_loads
from linkjax.machine._text import scene_text
from linkjax.machine._turns import check_turns
from linkjax.mechanism import Mechanism, StructureError


class Scene(eqx.Module):
    """A machine in operation: mechanism, loads, gravity (m/s²) and mean crank speed (rad/s).

    `speed` is positive (by default 1 rad/s, so that velocities equal kinematic coefficients), and `mean` defines it:
    "time" (2π turns / period) or "midrange" ((max + min) / 2). `target_delta` is the target coefficient of speed
    fluctuation δ, for which analyses find the flywheel; it may be None. `cycle_turns` is the number of crank turns
    after which motion and loads repeat. With `constant_speed` the crank turns at `speed` whatever the loads, and
    analyses omit the actual motion.

    `motor` is what drives the crank, with its transmission and rotor. With None the drive is a constant torque on the
    crank that balances the work of the loads over the cycle. A driver that follows a motion law has a `Servo` or None.

    `friction` is that of its joints, each once; the others have none. `useful` are the names of the loads whose work is
    what the machine is for; its efficiency counts them.

    Raises `StructureError` for an invalid value, for a load on an unknown link or point, and if the mechanism does not
    return to its initial position after `cycle_turns`, as far as its gears and motion law show.
    """

    mechanism: Mechanism
    loads: tuple[AbstractLoad, ...] = ()
    gravity: Vec = eqx.field(default_factory=lambda: Vec(0.0, 0.0))
    speed: Array = eqx.field(converter=as_float, default=1.0)
    target_delta: Array | None = eqx.field(converter=as_float, default=None)
    mean: Literal["time", "midrange"] = eqx.field(static=True, default="time")
    cycle_turns: int = eqx.field(static=True, default=1)
    title: str = eqx.field(static=True, default="")
    constant_speed: bool = eqx.field(static=True, default=False)
    motor: MotorDrive | None = None
    friction: tuple[AbstractFriction, ...] = ()
    useful: tuple[str, ...] = eqx.field(static=True, default=())

    def __check_init__(self):
        if not isinstance(self.mechanism, Mechanism):
            problem = f"is {type(self.mechanism).__name__}"
            raise StructureError("mechanism", problem, "write a Mechanism, e.g. from lj.library")
        for place, value in not_finite(self):
            raise StructureError(place, f"is {value}", "write a finite number")
        if self.mean not in ("time", "midrange"):
            raise StructureError("mean", f"is {self.mean!r}", 'write "time" or "midrange"')
        if not isinstance(self.cycle_turns, int) or self.cycle_turns < 1:
            raise StructureError("cycle_turns", f"is {self.cycle_turns!r}", "write an integer of 1 or more")
        if not isinstance(self.constant_speed, bool):
            raise StructureError("constant_speed", f"is {self.constant_speed!r}", "write True or False")
        if self.constant_speed and self.target_delta is not None:
            problem = "has no effect: at constant speed there is no speed fluctuation"
            raise StructureError("target_delta", problem, "delete target_delta or constant_speed")
        for name in ("speed", "target_delta"):
            value = known(getattr(self, name))
            if value is not None and not np.all(value > 0):
                also = '; Crank(rotation="cw") turns clockwise' if name == "speed" else ", e.g. 0.05"
                raise StructureError(name, f"is {value}", f"write a number above zero{also}")
        law = self.mechanism.driver.follows()
        if law is not None and abs(self.cycle / law.period() - round(self.cycle / law.period())) > 1e-9:
            problem = (
                f"the cycle of {self.cycle:.6g} rad is not a multiple of the period of the law, {law.period():.6g} rad"
            )
            raise StructureError("cycle_turns", problem, "write the number of crank turns after which the law repeats")
        check_turns(self.mechanism, self.cycle_turns)
        self._check_motor(law is not None)
        if law is not None and self.target_delta is not None:
            problem = "has no effect: the driver follows a law, so its speed does not fluctuate"
            raise StructureError("target_delta", problem, "delete target_delta or the law")
        if self.target_delta is not None and self.mechanism.driver.shaft() is None:
            problem = "has no effect: a flywheel needs a driving crank on the frame, and there is none"
            raise StructureError("target_delta", problem, "delete it")
        if not isinstance(self.loads, tuple) or not all(isinstance(load, AbstractLoad) for load in self.loads):
            problem = f"are {type(self.loads).__name__}"
            raise StructureError("loads", problem, "write a tuple of loads, (load,) for a single one")
        check_loads(self.mechanism, self.loads, self.cycle)
        check_friction(self.mechanism, self.friction)
        names = [load.name for load in self.loads]
        if not isinstance(self.useful, tuple):
            problem = f"are {type(self.useful).__name__}"
            raise StructureError("useful", problem, "write a tuple of names of loads, (name,) for a single one")
        for name in self.useful:
            if name not in names:
                raise StructureError("useful", f"there is no load {name!r}", nearest(name, names))

    def _check_motor(self, prescribed: bool) -> None:
        """Raise `StructureError` for anything but a motor, and for one that does not fit the way in which it drives."""
        if self.motor is None:
            return
        if not isinstance(self.motor, MotorDrive):
            problem = f"is {type(self.motor).__name__}"
            raise StructureError("motor", problem, "write a MotorDrive, e.g. MotorDrive(DCMotor(24.0, 0.5, 0.1))")
        servo = isinstance(self.motor.motor, Servo)
        if prescribed and not servo:
            problem = "its torque has no effect: the driver follows a motion law"
            raise StructureError("motor", problem, 'write a Servo (kind = "servo"), or delete the motor or the law')
        if servo and not prescribed and not self.constant_speed:
            problem = "a servo motor follows a motion law, and the driver has none"
            raise StructureError("motor", problem, "add a law, constant_speed = true, or write another kind of motor")

    def __str__(self) -> str:
        return scene_text(self)

    @property
    def cycle(self) -> float:
        """Length of the cycle in crank angle (rad)."""
        return 2 * math.pi * self.cycle_turns

    def active(self, side: Array) -> Array:
        """Which loads act at the crank angles `side` (rad): one or zero, shape (*side.shape, loads). Raises
        `StructureError` if a window is given by what happens, since a single crank angle does not show it."""
        each = []
        for load in self.loads:
            if isinstance(load.window, Passage):
                problem = f"its window depends on the motion of {load.window.of!r}, not on the crank angle alone"
                raise StructureError(f"load {load.name!r}", problem, "write lj.motion.at_crank_angles(scene) here")
            each.append(jnp.ones_like(side) if load.window is None else load.window.active(side, self.cycle))
        return jnp.stack(each, axis=-1) if each else jnp.zeros((*jnp.shape(side), 0))

    def with_mechanism(self, mechanism: Mechanism) -> Scene:
        """The same scene with another design of the same mechanism."""
        return dataclasses.replace(self, mechanism=jax.tree.map(as_float, mechanism))


def untitled(scene: Scene) -> Scene:
    """The scene without its title, which is no part of a compiled program."""
    if not scene.title:
        return scene
    plain = object.__new__(Scene)  # without the checks of the constructor: nothing else changes
    for field in dataclasses.fields(scene):
        object.__setattr__(plain, field.name, "" if field.name == "title" else getattr(scene, field.name))
    return plain


def check_scene(scene: object) -> None:
    """Raise `TypeError` if `scene` is not a `Scene`."""
    if not isinstance(scene, Scene):
        remedy = "write Scene(mechanism, loads, speed=...)" if isinstance(scene, Mechanism) else "write lj.load(name)"
        remedy = "write its .scene" if isinstance(scene, ReadyScene) else remedy
        raise TypeError(f"a Scene is needed, not {type(scene).__name__}; {remedy}")


@node
class ReadyScene:
    """A scene with the reference paths of its mechanism, for many evaluations; made by `ready`. `ends` are, for every
    load, the extremes of the coordinate that it asks for (None: of none)."""

    scene: Scene
    paths: tuple[Path | None, ...]
    ends: tuple[Any, ...] = ()

    @property
    def mechanism(self) -> Prepared:
        """The mechanism, prepared."""
        return Prepared(self.scene.mechanism, self.paths)

    def of(self, scene: Scene) -> ReadyScene:
        """Another scene with the same paths, which is right if positions are the same."""
        return ReadyScene(scene, self.paths, self.ends)

    def instant(self, phi: Array, side: Array, speed: Any = None) -> Instant:
        """The instant at which loads are evaluated: crank angle (rad), an angle on the side of limits at jumps, and
        the crank speed (rad/s), if it is known."""
        scene = self.scene
        pairs = zip(scene.loads, self.ends or (None,) * len(scene.loads), strict=True)
        ends = {load.name: both for load, both in pairs if both is not None}
        return Instant(phi, side, speed, scene.mechanism, ends)


def ready(scene: Scene | ReadyScene) -> ReadyScene:
    """The scene with its mechanism `prepared`, for many evaluations; unchanged if it is."""
    if isinstance(scene, ReadyScene):
        return scene
    made = prepared(scene.mechanism, scene.cycle_turns)
    return ReadyScene(scene, made.paths, ends_of(made, scene.loads, scene.cycle_turns))
