# pyright: reportAttributeAccessIssue=false
"""Machines solved by MuJoCo: positions from its own loop closures, the drive torque by its own inverse dynamics.

This method uses nothing of linkjax except the exported model, and the intended motion of the drive and the loads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

import linkjax as lj
from linkjax import MachineError
from linkjax._compile import compiled_soon
from linkjax.exchange import to_mjcf
from linkjax.forces import kinetostatics
from linkjax.groups import Crank
from linkjax.kinematics import pose
from linkjax.loads import Force, OpposingForce, Torque
from linkjax.machine import ReadyScene, ready
from tests.physics import oracle

NEAR, CLOSE = 1e-6, 1e-4  # tolerances: positions by the longest link, torques by the largest
STEPS = 96  # per turn, in the walk from one crank angle to the next
SHUT = 1e-13  # of the size of the machine: allowed closure error
START = 0.3  # rad, positions of the models
TURN = START + np.linspace(0.15, 2 * math.pi, 8)
AWAY = [
    side * 0.1 * 0.3**k for k in range(12) for side in (1, -1)
]  # rad, from the position of a model to the requested one
GAIN = 0.4  # crank acceleration, divided by the square of the crank speed
APART = 1e-3  # rad or m, of a joint, between positions for the curvature of the closures


class Found(NamedTuple):
    """At one crank angle: named points (m), shape (points, 2), and the drive torque (N m)."""

    points: np.ndarray
    torque: float


class Road:
    """A scene as a MuJoCo model at the crank angle `phi`."""

    def __init__(self, scene: lj.Scene, phi: float):
        self.scene, self.phi, self.law = scene, phi, scene.mechanism.driver.follows()
        self.start, self.text = phi, to_mjcf(scene, phi)
        self.model = mujoco.MjModel.from_xml_string(self.text)
        self.model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.data = mujoco.MjData(self.model)
        longest = max(float(link.length) for link in scene.mechanism.links.values())
        mujoco.mj_kinematics(self.model, self.data)
        self.size = longest or float(np.max(np.abs(self.data.site_xpos)))  # a machine of blocks only has no length
        self.move(phi)

    def coordinate(self, phi: float) -> float:
        """The position of the drive."""
        driver = self.scene.mechanism.driver
        if self.law is None:
            assert isinstance(driver, Crank)
            return driver.sense * (phi - self.start)
        return float(oracle.prescribed(self.law, phi) - oracle.prescribed(self.law, self.start))

    def rates(self, phi: float) -> tuple[float, float]:
        """The derivative of the drive position with respect to the crank angle, and its second derivative."""
        driver = self.scene.mechanism.driver
        if self.law is not None:
            first, second = oracle.swinging(self.law, phi)
            return float(first), float(second)
        assert isinstance(driver, Crank)
        return driver.sense, 0.0

    def closures(self) -> tuple[np.ndarray, np.ndarray]:
        """The closure errors of the constraints, and their Jacobian with a last row for the drive."""
        model, data = self.model, self.data
        mujoco.mj_fwdPosition(model, data)
        jacobian, drive = data.efc_J.reshape(data.nefc, model.nv), np.zeros((1, model.nv))
        mujoco.mju_sparse2dense(drive, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
        return data.efc_pos.copy(), np.vstack([jacobian, drive])

    def move(self, phi: float) -> None:
        """Close the loops at a crank angle, by Newton's method from the present position of the machine."""
        for _ in range(20):
            gap, jacobian = self.closures()
            wanted = self.coordinate(phi) - self.data.actuator_length[0]
            step = np.linalg.lstsq(jacobian, np.append(-gap, wanted), rcond=None)[0]
            self.data.qpos += step
            if np.max(np.abs(step)) < 1e-8:  # of second order: the remainder is below the last digit
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
        return self.solved(jacobian, np.append(0 * gap, self.rates(self.phi)[0]))

    def second(self, first: np.ndarray) -> np.ndarray:
        """Second ones, from the curvature of the closures along the first: fourth-order differences of their Jacobian,
        which is smooth at every position of the machine."""
        here, h = self.data.qpos.copy(), APART / np.max(np.abs(first))
        rates = {}
        for k in (-2, -1, 1, 2):
            self.data.qpos = here + first * (k * h)
            rates[k] = self.closures()[1] @ first
        self.data.qpos = here
        bent = (8 * (rates[1] - rates[-1]) - (rates[2] - rates[-2])) / (12 * h)
        bent[-1] -= self.rates(self.phi)[1]
        return self.solved(self.closures()[1], -bent)

    def solved(self, jacobian: np.ndarray, right: np.ndarray) -> np.ndarray:
        found, _, rank, _ = np.linalg.lstsq(jacobian, right, rcond=1e-9)
        assert rank == self.model.nv, "the closures do not say how the machine moves"
        return found

    def at(self, phi: float, speed: float, acceleration: float, names: list[str]) -> Found:
        """Results of MuJoCo at a crank angle, crank speed and acceleration: the torque is the generalised force of its
        inverse dynamics without constraints, projected on the direction of motion of the machine."""
        self.walk(phi)
        data, model, q1 = self.data, self.model, self.first()
        q2 = self.second(q1)
        data.qvel, data.qacc = q1 * speed, q2 * speed**2 + q1 * acceleration
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        mujoco.mj_inverse(model, data)
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        inertia_and_weight = float(q1 @ data.qfrc_inverse)
        self.move(phi)
        points = np.array([data.site(name).xpos[:2] for name in names])
        return Found(points, inertia_and_weight - self.power(q1))

    def power(self, q1: np.ndarray) -> float:
        """Of the applied loads, at unit crank speed."""
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
    """The largest relative differences of two methods: positions and drive torque."""

    position: float
    torque: float


@compiled_soon
def ours(made: ReadyScene, phi):
    """Points, and the drive torque while the crank accelerates."""
    scene = made.scene

    def at(phi):
        points = {name: jnp.stack([p.r.x, p.r.y]) for name, p in pose(made.mechanism, phi).points.items()}
        return points, kinetostatics(made, phi, scene.speed, GAIN * scene.speed**2).drive_torque

    return jax.vmap(at)(phi)


def beside(scene: lj.Scene, phi: float) -> Road:
    """A model near this crank angle, as far away as the machine can be assembled there."""
    for away in AWAY:
        try:
            return Road(scene, phi + away)
        except MachineError:  # a singular position lies between
            continue
    raise AssertionError("it can be assembled nowhere beside this crank angle")


def compared(scene: lj.Scene, only: float | None = None) -> Apart:
    """Results of MuJoCo against ours, at crank angles over the turn, or at this one."""
    angles = TURN if only is None else np.array([only])
    points, torque = jax.device_get(ours(ready(scene), jnp.asarray(angles)))
    road, speed = Road(scene, START) if only is None else beside(scene, only), float(scene.speed)
    found = [road.at(phi, speed, GAIN * speed**2, list(points)) for phi in angles]
    wanted = np.stack(list(points.values()), axis=1)
    position = np.max(np.abs(np.stack([f.points for f in found]) - wanted)) / road.size
    apart = np.max(np.abs(np.array([f.torque for f in found]) - torque))
    return Apart(float(position), float(apart / np.max(np.abs(torque))))


def check(scene: lj.Scene, name: str, figures: dict[str, Apart], only: float | None = None) -> None:
    """Both methods must agree; their differences are recorded."""
    figures[name] = apart = compared(scene, only)
    assert apart.position <= NEAR, name
    assert apart.torque <= CLOSE, name
