"""Harmonics over the crank angle: closed forms of jumps and of smooth functions, Parseval, derivatives."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from tests.physics.driven import slider_crank

ON, OFF, SIZE = 0.7, 2.9, 40.0


def punch(on=ON, turns: int = 1) -> lj.Scene:
    """A wheel with a torque against it in a window."""
    links = {"wheel": lj.Link(length=0.1, inertia=0.6)}
    wheel = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, [lj.Crank("wheel", "A", "B")], lj.Flywheel(0.0))
    load = lj.OpposingTorque("punch", "wheel", magnitude=SIZE, window=lj.Window(on, OFF))
    return lj.Scene(wheel, (load,), speed=10.0, cycle_turns=turns)


def of_window(order, on=ON, turns: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Fourier coefficients of a pulse: those of the cosine and of the sine."""
    unit = SIZE / (math.pi * turns * order)
    return unit * (np.sin(order * OFF) - np.sin(order * on)), unit * (np.cos(order * on) - np.cos(order * OFF))


@pytest.mark.parametrize("turns", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_window(turns):
    """Amplitudes and phases of a rectangle, up to high orders; in two turns with half orders."""
    found = lj.harmonics(punch(turns=turns), "drive_torque_constant_speed", orders=30)
    np.testing.assert_allclose(found.order, np.arange(1, 30 * turns + 1) / turns)
    a, b = of_window(np.asarray(found.order), turns=turns)
    got = np.asarray(found.amplitude) * np.exp(1j * np.asarray(found.phase))
    np.testing.assert_allclose(got, a + 1j * b, atol=1e-12 * SIZE)
    share = (OFF - ON) / (2 * math.pi * turns)
    assert float(found.mean) == pytest.approx(SIZE * share, rel=1e-13)
    assert float(found.rms) == pytest.approx(SIZE * math.sqrt(share), rel=1e-13)


def test_the_derivative_by_the_end_of_a_window():
    """d/d on of the pulse: its coefficients have closed derivatives."""

    def third(on):
        found = lj.harmonics(punch(on), "drive_torque_constant_speed", orders=3)
        return found.amplitude[2]

    slope = float(jax.grad(third)(jnp.asarray(ON)))
    h = 1e-6
    sizes = [math.hypot(*(float(x) for x in of_window(3.0, ON + sign * h))) for sign in (1, -1)]
    assert slope == pytest.approx((sizes[0] - sizes[1]) / (2 * h), rel=1e-7)


def test_a_circle_and_parseval():
    """The crank pin has one harmonic; the piston's series has its root mean square."""
    scene = slider_crank(pump=None)
    pin = lj.harmonics(scene, "x.B", orders=4)
    np.testing.assert_allclose(pin.amplitude, [0.1, 0, 0, 0], atol=1e-13)
    assert float(pin.phase[0]) == pytest.approx(0.0, abs=1e-12)
    side = lj.harmonics(scene, "y.B", orders=1)
    assert float(side.phase[0]) == pytest.approx(math.pi / 2)
    piston = lj.harmonics(scene, "x.D", orders=24)
    total = float(piston.mean) ** 2 + 0.5 * float(jnp.sum(piston.amplitude**2))
    assert total == pytest.approx(float(piston.rms) ** 2, rel=1e-13)
    phi = np.linspace(0, 2 * np.pi, 512, endpoint=False)
    x = 0.1 * np.cos(phi) + np.sqrt(0.3**2 - (0.1 * np.sin(phi)) ** 2)
    np.testing.assert_allclose(piston.amplitude, 2 * np.abs(np.fft.rfft(x))[1:25] / 512, atol=1e-12)


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("velocity.D", "is a vector"),
        ("max_drive_torque", "no quantity over the crank angle"),
        ("delta", "is not a quantity over the crank angle"),
        ("motor_torque", "has no motor"),
        ("x.Q", "there is no point"),
    ],
)
def test_what_has_no_harmonics(what, says):
    with pytest.raises(lj.StructureError, match=says):
        lj.harmonics(slider_crank(), what)


def test_orders():
    with pytest.raises(ValueError, match="orders must be an integer"):
        lj.harmonics(punch(), orders=0)
