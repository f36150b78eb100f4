"""Forces, powers and works of loads over the cycle, and the balance of energy by source and sink."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import linkjax as lj
from linkjax.motion import make_grid, split_work
from tests.physics.driven import line, slider_crank

CRANK, ROD = 0.1, 0.3
STIFFNESS, FREE, DRAG = 900.0, 0.25, 7.0
TABLE = [0.0, 40.0, -60.0, 25.0]  # N, along the guide, every 90 degrees


@functools.cache
def analysed(kind: str) -> Any:
    """Analysed machines; those of the slider-crank have a spring, drag, and a table at the piston."""
    if kind == "press":
        return lj.analyse(lj.load("hay-press"))
    if kind == "cylinder":
        return lj.analyse(lj.load("oscillating-cylinder"))
    if kind == "pump":
        return lj.analyse(slider_crank(line()), angles=24)
    motor = line(transmission=lj.Transmission(2.0, 0.9, 0.8), inertia=2e-4, no_load=80.0)
    scene = slider_crank(motor if "motor" in kind else None, flywheel=0.2, pump=DRAG, gravity=lj.Vec(0.0, -9.81))
    spring = lj.Spring("spring", "slider", "D", to_point="A", stiffness=STIFFNESS, free_length=FREE)
    table = lj.Table.row("table", "slider", "D", values=TABLE)
    scene = dataclasses.replace(scene, loads=(*scene.loads, spring, table))
    return lj.analyse(scene, constant_speed="still" in kind)


def piston(phi: float) -> tuple[float, float]:
    """Position of the piston (m) and its derivative with respect to the crank angle."""
    root = math.sqrt(ROD**2 - (CRANK * math.sin(phi)) ** 2)
    slope = -CRANK * math.sin(phi) - CRANK**2 * math.sin(phi) * math.cos(phi) / root
    return CRANK * math.cos(phi) + root, slope


def closes(cycle: Any) -> float:
    """What is supplied minus what is absorbed, relative to the largest of the works."""
    works = cycle.energies.values()
    largest = max(float(max(work.supplied, work.absorbed)) for work in works)
    assert all(work.supplied >= 0 and work.absorbed >= 0 for work in works)
    return abs(float(sum(work.net for work in works))) / largest


SLOW = [
    pytest.param(kind, marks=pytest.mark.slow)
    for kind in ("press", "motor", "still with a motor", "driven", "cylinder")
]


@pytest.mark.parametrize("kind", ["pump", "still", *SLOW])
def test_all_that_is_supplied_is_absorbed(kind):
    cycle = analysed(kind)
    assert closes(cycle) < 1e-9
    names = ["motor", "transmission"] if "motor" in kind else ["motor" if kind == "pump" else "drive"]
    assert list(cycle.energies) == [*names, "gravity", *(load.name for load in cycle.scene.loads)]
    assert list(cycle.loads) == ["gravity", *(load.name for load in cycle.scene.loads)]


@pytest.mark.parametrize("kind", ["pump", *SLOW[:2]])
def test_the_motor_by_another_quadrature(kind):
    """The kinetostatic drive torque, with rotor and losses, has the same works."""
    cycle = analysed(kind)
    assert float(cycle.energies["motor"].net) == pytest.approx(float(cycle.motor.energy), rel=1e-7)
    if kind == "pump":
        assert "transmission" not in cycle.energies and float(cycle.motor.loss) == pytest.approx(0, abs=1e-9)
        return
    assert float(cycle.energies["transmission"].absorbed) == pytest.approx(float(cycle.motor.loss), rel=1e-6)


@pytest.mark.slow
def test_the_drive_in_the_actual_motion():
    cycle = analysed("driven")
    assert float(cycle.energies["drive"].supplied) == pytest.approx(float(cycle.work["drive"]), rel=1e-12)
    for name in ("gravity", "pump", "spring", "table"):
        assert float(cycle.loads[name].energy) == pytest.approx(float(cycle.work[name]), rel=1e-9, abs=1e-9)


def test_works_at_constant_speed_by_an_independent_quadrature():
    loads, speed = analysed("still").loads, float(analysed("still").scene.speed)
    pump = quad(lambda phi: DRAG * speed * piston(phi)[1] ** 2, 0, 2 * math.pi, epsabs=1e-13)[0]
    assert float(loads["pump"].absorbed) == pytest.approx(pump, rel=1e-10)
    assert float(loads["pump"].supplied) == pytest.approx(0, abs=1e-12)
    stretch = (CRANK + ROD - FREE, ROD - CRANK - FREE)  # it is relaxed on the way
    stored = 0.5 * STIFFNESS * (stretch[0] ** 2 + stretch[1] ** 2)
    assert float(loads["spring"].supplied) == pytest.approx(stored, rel=1e-8)
    assert float(loads["spring"].absorbed) == pytest.approx(stored, rel=1e-8)

    def torque(phi):
        return np.interp(phi, np.linspace(0, 2 * math.pi, 5), [*TABLE, TABLE[0]]) * piston(phi)[1]

    zeros = [0.5 * math.pi + 0.5 * math.pi * 0.4, math.pi + 0.5 * math.pi * 60 / 85]
    edges = sorted([*np.linspace(0, 2 * math.pi, 5), *zeros])
    parts = [quad(torque, low, high, epsabs=1e-13)[0] for low, high in itertools.pairwise(edges)]
    assert float(loads["table"].supplied) == pytest.approx(sum(part for part in parts if part > 0), rel=1e-8)
    assert float(loads["table"].absorbed) == pytest.approx(-sum(part for part in parts if part < 0), rel=1e-8)


@pytest.mark.parametrize("kind", ["still", SLOW[0]])
def test_power_is_that_of_the_force_as_it_acts(kind):
    cycle = analysed(kind)
    speed = cycle.scene.speed if cycle.speed is None else cycle.speed
    for load in cycle.scene.loads:
        run = cycle.loads[load.name]
        velocity = cycle.pose.points[load.point].dr
        power = speed * (run.force.fx * velocity.x + run.force.fy * velocity.y)
        size = float(jnp.max(jnp.abs(run.power)))
        np.testing.assert_allclose(run.power, power, atol=1e-10 * size)


@pytest.mark.slow
def test_a_force_is_zero_outside_of_its_window():
    cycle = analysed("press")
    (load,), on = cycle.scene.loads, cycle.scene.active(cycle.angles)[:, 0]
    force = cycle.loads["hay"].force
    np.testing.assert_allclose(np.hypot(force.fx, force.fy), on * load.magnitude, rtol=1e-12)


def test_the_zero_of_a_torque_has_no_derivative():
    """a + sin φ is positive over π + 2 asin(a), which is the derivative of what it supplies with respect to a."""
    grid = make_grid(lj.load("slider-crank"), 96)

    def supplied(a):
        return split_work.function(grid.half, (a + jnp.sin(grid.nodes),))[0].supplied

    a = 0.3
    width = math.pi + 2 * math.asin(a)
    value, slope = jax.value_and_grad(supplied)(a)
    assert float(value) == pytest.approx(a * width + 2 * math.sqrt(1 - a * a), rel=1e-10)
    assert float(slope) == pytest.approx(width, rel=1e-10)


@pytest.mark.slow
def test_where_a_motion_does_not_exist_loads_that_depend_on_its_speed_have_no_energy():
    weak = slider_crank(line(stall=0.01), pump=50.0)
    cycle = lj.analyse(weak)
    assert cycle.missing is not None and cycle.loads is None and cycle.energies is None
