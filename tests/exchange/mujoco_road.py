# pyright: reportAttributeAccessIssue=false
"""Machines solved by MuJoCo: positions from its own loop closures, the drive torque by its own inverse dynamics.

Nothing of linkjax is used on that road but the exported model, and what the drive and the loads are meant to do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.exchange import to_mjcf
from linkjax.forces import kinetostatics
from linkjax.groups import Crank
from linkjax.kinematics import pose
from linkjax.loads import Force, OpposingForce, Torque
from linkjax.machine import ready
from tests.physics import oracle

NEAR, CLOSE = 1e-6, 1e-4  # what is asked for: positions by the longest link, torques by the largest
STEPS = 96  # a turn, of the walk from one crank angle to the next
SHUT = 1e-13  # of the size of the machine: what closures may leave open
START = 0.3  # rad, where the models stand
TURN = START + np.linspace(0.15, 2 * math.pi, 8)
GAIN = 0.4  # crank acceleration, by the square of the crank speed
APART = 1e-3  # rad, between crank angles that give the second kinematic coefficients


class Found(NamedTuple):
    """At one crank angle: named points (m), shape (points, 2), and the drive torque (N m)."""

    points: np.ndarray
    torque: float


class Road:
    """A scene as MuJoCo's model, standing at the crank angle `phi`."""

    def __init__(self, scene: lj.Scene, phi: float):
        self.scene, self.phi, self.law = scene, phi, scene.mechanism.driver.follows()
        self.start, self.text = phi, to_mjcf(scene, phi)
        self.model = mujoco.MjModel.from_xml_string(self.text)
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.model)
        self.drive = self.model.jnt_dofadr[self.model.actuator("drive").trnid[0]]
        self.size = max(float(link.length) for link in scene.mechanism.links.values())
        self.move(phi)

    def coordinate(self, phi: float) -> float:
        """Where the drive stands."""
        driver = self.scene.mechanism.driver
        if self.law is None:
            assert isinstance(driver, Crank)
            return driver.turns * (phi - self.start)
        return float(oracle.prescribed(self.law, phi) - oracle.prescribed(self.law, self.start))

    def rate(self, phi: float) -> float:
        """By how much the drive moves on with the crank angle."""
        driver = self.scene.mechanism.driver
        if self.law is not None:
            return float(oracle.swinging(self.law, phi)[0])
        assert isinstance(driver, Crank)
        return driver.turns

    def closures(self) -> tuple[np.ndarray, np.ndarray]:
        """What the constraints leave open, and their Jacobian with a last row for the drive."""
        mujoco.mj_fwdPosition(self.model, self.data)
        jacobian = self.data.efc_J.reshape(self.data.nefc, self.model.nv)
        return self.data.efc_pos.copy(), np.vstack([jacobian, np.eye(self.model.nv)[self.drive]])

    def move(self, phi: float) -> None:
        """Close the loops at a crank angle, by Newton's method from where the machine stands."""
        for _ in range(20):
            gap, jacobian = self.closures()
            wanted = self.coordinate(phi) - self.data.qpos[self.drive]
            step = np.linalg.lstsq(jacobian, np.append(-gap, wanted), rcond=None)[0]
            self.data.qpos += step
            if np.max(np.abs(step)) < 1e-8:  # of second order: what is left is below the last digit
                break
        gap, _ = self.closures()
        assert np.max(np.abs(gap), initial=0.0) < SHUT * max(self.size, 1.0), f"not closed at {phi}"
        self.phi = phi

    def walk(self, phi: float) -> None:
        """Move on to a crank angle in small steps, each begun along the tangent."""
        count = max(1, math.ceil(abs(phi - self.phi) * STEPS / (2 * math.pi)))
        for angle in np.linspace(self.phi, phi, count + 1)[1:]:
            self.data.qpos += self.first() * (angle - self.phi)
            self.move(angle)

    def first(self) -> np.ndarray:
        """First kinematic coefficients of the joint coordinates."""
        gap, jacobian = self.closures()
        found, _, rank, _ = np.linalg.lstsq(jacobian, np.append(0 * gap, self.rate(self.phi)), rcond=1e-9)
        assert rank == self.model.nv, "the closures do not say how the machine moves"
        return found

    def second(self) -> np.ndarray:
        """Second ones, from differences of the first, of fourth order."""
        phi, here = self.phi, self.data.qpos.copy()
        tangent, rates = self.first(), {}
        for k in (-2, -1, 1, 2):
            self.data.qpos = here + tangent * (k * APART)
            self.move(phi + k * APART)
            rates[k] = self.first()
        self.data.qpos = here
        self.move(phi)
        return (8 * (rates[1] - rates[-1]) - (rates[2] - rates[-2])) / (12 * APART)

    def at(self, phi: float, speed: float, acceleration: float, names: list[str]) -> Found:
        """What MuJoCo finds at a crank angle, crank speed and acceleration: the torque is the generalised force that
        its inverse dynamics asks for without constraints, projected on how the machine moves."""
        self.walk(phi)
        q1, q2, data, model = self.first(), self.second(), self.data, self.model
        data.qvel, data.qacc = q1 * speed, q2 * speed**2 + q1 * acceleration
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        mujoco.mj_inverse(model, data)
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        inertia_and_weight = float(q1 @ data.qfrc_inverse)
        self.move(phi)
        points = np.array([data.site(name).xpos[:2] for name in names])
        return Found(points, inertia_and_weight - self.power(q1))

    def power(self, q1: np.ndarray) -> float:
        """Of the working loads, at unit crank speed."""
        total = 0.0
        for load in self.scene.loads:
            if not oracle.active(load, np.asarray(self.phi), self.scene.cycle):
                continue
            along, turning = np.zeros((2, 3, self.model.nv))
            if load.point:
                mujoco.mj_jacSite(self.model, self.data, along, turning, self.data.site(load.point).id)
            else:
                mujoco.mj_jacBody(self.model, self.data, along, turning, self.data.body(load.link).id)
            v, w = (along @ q1)[:2], float((turning @ q1)[2])
            if isinstance(load, Force):
                total += float(load.force.x) * v[0] + float(load.force.y) * v[1]
            elif isinstance(load, OpposingForce):
                total -= float(load.magnitude) * np.hypot(*v)
            elif isinstance(load, Torque):
                total += float(load.torque) * w
            else:
                total -= float(load.magnitude) * abs(w)
        return total


class Apart(NamedTuple):
    """How far two roads are apart at worst, relative: positions and drive torque."""

    position: float
    torque: float


@compiled_soon
def ours(scene: lj.Scene, phi):
    """Points, and the drive torque while the crank speeds up."""

    def at(phi):
        points = {name: jnp.stack([p.r.x, p.r.y]) for name, p in pose(scene.mechanism, phi).points.items()}
        return points, kinetostatics(scene, phi, scene.speed, GAIN * scene.speed**2).drive_torque

    return jax.vmap(at)(phi)


def compared(scene: lj.Scene) -> Apart:
    """MuJoCo's figures against ours, at crank angles all round the turn."""
    points, torque = jax.device_get(ours(ready(scene), jnp.asarray(TURN)))
    road, speed = Road(scene, START), float(scene.speed)
    found = [road.at(phi, speed, GAIN * speed**2, list(points)) for phi in TURN]
    wanted = np.stack(list(points.values()), axis=1)
    position = np.max(np.abs(np.stack([f.points for f in found]) - wanted)) / road.size
    apart = np.max(np.abs(np.array([f.torque for f in found]) - torque))
    return Apart(float(position), float(apart / np.max(np.abs(torque))))


def check(scene: lj.Scene, name: str, figures: dict[str, Apart]) -> None:
    """Both roads must agree; how far they are apart is noted."""
    figures[name] = apart = compared(scene)
    assert apart.position <= NEAR, name
    assert apart.torque <= CLOSE, name
