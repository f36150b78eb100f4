# pyright: reportAttributeAccessIssue=false
"""Incline and wedge press as contacts in MuJoCo, whose friction is soft and whose steps are of first order: the force
that keeps up a constant speed, within its convergence."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from linkjax import elements

WEIGHT, STEP, TIME = 20.0, 1e-5, 0.3  # N, s, s
SPEED, MASS, LIGHT = 0.5, 2.0, 0.2  # m/s, kg
CLOSE = 1e-4  # measured: 2e-6 on the incline, 3e-5 with three contacts
CONTACT = 'condim="3" solref="0.002 4" solimp="0.99 0.999 0.001"'


def model(body: str, friction: float) -> mujoco.MjModel:
    """Bodies on a floor; elliptic friction cones, as pyramids have less friction along their edges, and hardly any
    creep."""
    text = f"""<mujoco><option timestep="{STEP}" cone="elliptic" impratio="1000" integrator="implicitfast"
    tolerance="1e-14" iterations="300" gravity="0 0 0"/>
    <default><geom friction="{friction} 0 0" {CONTACT}/></default><worldbody>{body}</worldbody></mujoco>"""
    return mujoco.MjModel.from_xml_string(text)


def gain(model: mujoco.MjModel, forces: list[float], speeds: list[float]) -> float:
    """Acceleration of the first coordinate under constant forces (N), in the second half of the time."""
    data = mujoco.MjData(model)
    data.qfrc_applied[:], data.qvel[:] = forces, speeds
    count = round(TIME / float(model.opt.timestep))
    seen = []
    for _ in range(count):
        mujoco.mj_step(model, data)
        seen.append((data.time, data.qvel[0]))
    t, v = np.array(seen[count // 2 :]).T
    return float(np.polyfit(t, v, 1)[0])


def needed(model: mujoco.MjModel, guess: float, forces, speeds: list[float]) -> float:
    """The force (N) without acceleration, between two on either side of a guess."""
    tried = [0.99 * guess, 1.01 * guess]  # the motion does not come to rest
    low, high = (gain(model, forces(each), speeds) for each in tried)
    assert low < 0 < high
    return tried[0] - low * (tried[1] - tried[0]) / (high - low)


@pytest.mark.parametrize(("degrees", "friction"), [(20.0, 0.1), (30.0, 0.3)])
def test_a_body_up_an_incline(degrees, friction):
    """A horizontal force moves it up: the floor is the incline, weight and force have components along it."""
    a = math.radians(degrees)
    known = float(elements.incline(a, friction, WEIGHT).forward.effort)
    body = f"""<geom type="plane" size="9 9 1"/><body pos="0 0 0.05"><joint type="slide" axis="1 0 0"/>
    <joint type="slide" axis="0 0 1"/><geom type="box" size="0.1 0.1 0.05" mass="{MASS}"/></body>"""

    def forces(push: float) -> list[float]:
        return [push * math.cos(a) - WEIGHT * math.sin(a), -push * math.sin(a) - WEIGHT * math.cos(a)]

    assert needed(model(body, friction), known, forces, [SPEED, 0.0]) == pytest.approx(known, rel=CLOSE)


@pytest.mark.parametrize(("degrees", "friction"), [(15.0, 0.1), (25.0, 0.2)])
def test_a_wedge_press(degrees, friction):
    """A wedge on the floor lifts a ball that leans on a wall, with friction on all three faces."""
    a, radius = math.radians(degrees), 0.05
    known = float(elements.wedge_press(a, friction, WEIGHT).forward.effort)
    half, thick = 0.4, 0.02  # of the inclined plate of the wedge, whose upper face passes through its origin
    plate = f"{-thick * math.sin(a)} 0 {0.3 - thick * math.cos(a)}"
    ball = f"{radius * math.sin(a)} 0 {0.3 + radius * math.cos(a)}"
    wall = radius * (1 + math.sin(a))
    body = f"""<geom type="plane" size="9 9 1" contype="1" conaffinity="2"/>
    <geom type="plane" pos="{wall} 0 0" euler="0 -90 0" size="9 9 1" contype="4" conaffinity="8"/>
    <body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
    <geom type="box" pos="0 0 0.02" size="0.1 0.1 0.02" mass="{LIGHT}" contype="2" conaffinity="1"/>
    <geom type="box" pos="{plate}" euler="0 {degrees} 0" size="{half} 0.1 {thick}" mass="{LIGHT}"
    contype="16" conaffinity="32"/></body>
    <body pos="{ball}"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
    <geom type="sphere" size="{radius}" mass="{MASS}" contype="40" conaffinity="20"/></body>"""

    def forces(push: float) -> list[float]:
        return [push, 0.0, 0.0, -WEIGHT]

    speeds = [SPEED, 0.0, 0.0, SPEED * math.tan(a)]
    assert needed(model(body, friction), known, forces, speeds) == pytest.approx(known, rel=CLOSE)
