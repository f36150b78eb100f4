"""Closed forms of friction against equilibrium of forces, quadrature of pressures, and printed numbers."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from linkjax import elements

DEG = math.pi / 180
ELEMENTS = {
    "slider": (elements.slider, {"angle": 30 * DEG, "friction": 0.1, "load": 120.0}),
    "incline": (elements.incline, {"angle": 20 * DEG, "friction": 0.1, "load": 120.0}),
    "screw": (elements.screw, {"diameter": 0.02, "lead": 0.005, "friction": 0.1, "load": 900.0, "flank": 15 * DEG}),
    "wedge press": (elements.wedge_press, {"angle": 20 * DEG, "friction": 0.1, "load": 120.0}),
    "gripping cam": (
        elements.gripping_cam,
        {"eccentricity": 0.02, "radius": 0.03, "angle": 25 * DEG, "friction": 0.1, "load": 500.0, "pivot": 8e-4},
    ),
    "journal": (elements.journal, {"radius": 0.01, "friction": 0.1, "load": 300.0, "distance": 0.004}),
    "thrust ring": (elements.thrust_ring, {"outer": 0.05, "friction": 0.1, "load": 1000.0, "inner": 0.02}),
}


def turned(vector: np.ndarray, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]]) @ vector


def leaning(normal: np.ndarray, slides: np.ndarray, phi: float) -> np.ndarray:
    """Direction of the total reaction on a body that slides: the normal, leaning against the motion by φ."""
    one, other = turned(normal, phi), turned(normal, -phi)
    return one if one @ slides < other @ slides else other


@pytest.mark.parametrize("sense", [1, -1])
def test_slider_in_equilibrium(sense: int):
    gamma, f, q = 0.7, 0.15, 80.0
    # unknown push P at γ to the normal (into the guide, from above), and the reaction; the load is -Q x
    push = np.array([math.sin(gamma), -math.cos(gamma)])
    reaction = leaning(np.array([0.0, 1.0]), np.array([sense, 0.0]), math.atan(f))
    effort, _ = np.linalg.solve(np.stack([push, reaction], axis=1), [q, 0.0])
    found = elements.slider(gamma, f, q)
    way = found.forward if sense > 0 else found.backward
    assert way.effort == pytest.approx(effort, rel=1e-13)
    spent, obtained = effort * math.sin(gamma), q  # work along the guide, per metre
    assert way.efficiency == pytest.approx(obtained / spent if sense > 0 else spent / obtained, rel=1e-13)


@pytest.mark.parametrize("sense", [1, -1])
def test_incline_in_equilibrium(sense: int):
    alpha, f, q = 0.35, 0.12, 80.0
    along, normal = np.array([math.cos(alpha), math.sin(alpha)]), np.array([-math.sin(alpha), math.cos(alpha)])
    reaction = leaning(normal, sense * along, math.atan(f))
    effort, _ = np.linalg.solve(np.stack([[1.0, 0.0], reaction], axis=1), [0.0, q])
    found = elements.incline(alpha, f, q)
    way = found.forward if sense > 0 else found.backward
    spent, obtained = effort * along[0], q * along[1]
    assert way.effort == pytest.approx(effort, rel=1e-13)
    assert way.efficiency == pytest.approx(obtained / spent if sense > 0 else spent / obtained, rel=1e-13)


@pytest.mark.parametrize("sense", [1, -1])
def test_both_wedges_in_equilibrium(sense: int):
    """The lower wedge moves in x on the base; the upper one moves in y along a wall, and carries the load."""
    alpha, f, q = 20 * DEG, 0.1, 1.0
    phi = math.atan(f)
    face = np.array([math.cos(alpha), -math.sin(alpha)])  # the lower wedge rises towards -x: driven in +x it lifts
    normal = np.array([math.sin(alpha), math.cos(alpha)])  # of the upper wedge, away from the lower one
    relative = sense * (np.array([0.0, math.tan(alpha)]) - np.array([1.0, 0.0]))  # of the upper wedge against the lower
    assert abs(relative @ normal) < 1e-15 and abs(abs(relative @ face) - np.linalg.norm(relative)) < 1e-15
    between = leaning(normal, relative, phi)
    wall = leaning(np.array([-1.0, 0.0]), np.array([0.0, sense]), phi)
    base = leaning(np.array([0.0, 1.0]), np.array([sense, 0.0]), phi)
    # upper: between N + wall W = (0, q); lower: -between N + base B + (P, 0) = 0
    matrix = np.zeros((4, 4))
    matrix[:2, 0], matrix[:2, 1] = between, wall
    matrix[2:, 0], matrix[2:, 2], matrix[2:, 3] = -between, base, [1.0, 0.0]
    effort = np.linalg.solve(matrix, [0.0, q, 0.0, 0.0])[3]
    found = elements.wedge_press(alpha, f, q)
    way = found.forward if sense > 0 else found.backward
    assert way.effort == pytest.approx(effort, rel=1e-13)
    ratio = q * math.tan(alpha) / effort
    assert way.efficiency == pytest.approx(ratio if sense > 0 else 1 / ratio, rel=1e-13)


def test_gripping_cam_in_equilibrium():
    e, r, delta, f, n, rho = 0.02, 0.03, 25 * DEG, 0.1, 500.0, 8e-4
    centre = e * np.array([math.sin(delta), -math.cos(delta)])
    contact = centre + np.array([0.0, -r])
    found = elements.gripping_cam(e, r, delta, f, n, rho)
    for way, grips in ((found.forward, 1), (found.backward, -1)):
        turn = -grips  # gripping, the eccentricity turns clockwise towards the work
        slides = turn * np.array([-contact[1], contact[0]])
        force = n * np.array([-math.copysign(f, slides[0]), 1.0])
        moment = contact[0] * force[1] - contact[1] * force[0]
        torque = moment + grips * rho * np.linalg.norm(force)  # friction of the pivot resists the motion
        assert way.effort == pytest.approx(torque, rel=1e-13)
        rise = n * e * math.sin(delta)  # work on the work piece per radian, from the distance e cos δ + r
        assert way.efficiency == pytest.approx(rise / torque if grips > 0 else torque / rise, rel=1e-13)


def test_thrust_faces_by_quadrature():
    big, small, f, q = 0.05, 0.02, 0.1, 1000.0
    for bearing, pressure in (("unworn", lambda x: 1.0), ("run-in", lambda x: 1 / x)):
        load = quad(lambda x, p=pressure: p(x) * 2 * math.pi * x, small, big)[0]
        torque = quad(lambda x, p=pressure: f * p(x) * 2 * math.pi * x * x, small, big)[0] * q / load
        assert elements.thrust_ring(big, f, q, small, bearing=bearing).torque == pytest.approx(torque, rel=1e-12)
    assert elements.thrust_ring(0.05, 0.1, 1000.0, 0.02).torque == pytest.approx(3.714285714285714, rel=1e-14)
    assert elements.thrust_ring(0.05, 0.1, 1000.0, 0.02, bearing="run-in").torque == pytest.approx(3.5, rel=1e-14)
    assert elements.thrust_ring(0.05, 0.1, 1000.0).radius == pytest.approx(0.05 * 2 / 3, rel=1e-14)


def test_journals_by_quadrature():
    """The friction of all elements of the surface over the load, for a uniform pressure and one as a cosine."""
    for bearing, pressure in (("unworn", lambda a: 1.0), ("run-in", math.cos)):
        load = quad(lambda a, p=pressure: p(a) * math.cos(a), -math.pi / 2, math.pi / 2)[0]
        total = quad(pressure, -math.pi / 2, math.pi / 2)[0]
        assert elements.journal_friction(0.1, bearing) == pytest.approx(0.1 * total / load, rel=1e-12)
    found = elements.journal(0.01, 0.1, 300.0, 0.004, bearing="run-in")
    assert found.torque == pytest.approx(4 / math.pi * 0.1 * 300 * 0.01, rel=1e-14)
    assert found.margin == pytest.approx(0.004 - 4 / math.pi * 1e-3, rel=1e-13)
    assert elements.journal(0.01, 0.1, 300.0, 0.0005).margin < 0 > elements.journal(0.01, 0.1, 1.0, 0.0005).efficiency


def test_printed_numbers():
    """Wedge press and screw of the textbook's chapter, and the reflection about 45° of the wedge's two efficiencies."""
    wedge = elements.wedge_press(20 * DEG, 0.1)
    assert wedge.forward.effort == pytest.approx(0.6109102650295201, rel=1e-13)
    assert wedge.forward.efficiency == pytest.approx(0.5957834646118031, rel=1e-13)
    assert wedge.backward.efficiency == pytest.approx(0.41447777903285904, rel=1e-13)
    assert wedge.backward.limit / DEG == pytest.approx(11.421186274999286, rel=1e-13)
    assert wedge.forward.limit / DEG == pytest.approx(78.57881372500071, rel=1e-13)
    middle = elements.wedge_press(45 * DEG, 0.1)
    assert middle.forward.efficiency == pytest.approx(float(middle.backward.efficiency), rel=1e-13)
    square, triangular = elements.screw(0.02, 0.005, 0.1), elements.screw(0.02, 0.005, 0.1, flank=30 * DEG)
    assert square.forward.effort == pytest.approx(0.001810179667558294, rel=1e-13)
    assert square.backward.effort == pytest.approx(-0.00020261294197801397, rel=1e-12)
    assert square.forward.efficiency == pytest.approx(0.43961090145978554, rel=1e-13)
    assert square.backward.efficiency == pytest.approx(-0.2546109320161375, rel=1e-12)
    assert triangular.friction_angle / DEG == pytest.approx(6.586775553629462, rel=1e-13)
    assert triangular.forward.efficiency == pytest.approx(0.4042412162504447, rel=1e-13)
    assert elements.incline(20 * DEG, 0.1).forward.effort == pytest.approx(0.481495, abs=5e-7)


def at_limit(name: str, way: str) -> dict[str, float]:
    function, given = ELEMENTS[name]
    limit = float(getattr(function(**given), way).limit)
    if name == "screw":
        return {**given, "lead": math.pi * given["diameter"] * math.tan(limit)}
    return {**given, "angle": limit}


@pytest.mark.parametrize(
    ("name", "way"),
    [("slider", "forward"), ("gripping cam", "backward")]
    + [(name, way) for name in ("incline", "screw", "wedge press") for way in ("forward", "backward")],
)
def test_at_its_limit_the_efficiency_is_zero(name: str, way: str):
    function, _ = ELEMENTS[name]
    found = getattr(function(**at_limit(name, way)), way)
    assert abs(found.margin) < 1e-15 and abs(found.efficiency) < 1e-14


def test_beyond_the_limit_no_effort_suffices():
    assert elements.slider(0.05, 0.1).forward.effort == math.inf
    assert elements.incline(85 * DEG, 0.1).forward.effort == math.inf
    assert elements.wedge_press(79 * DEG, 0.1).forward.efficiency < 0
    assert (
        elements.gripping_cam(0.003, 0.05, 80 * DEG, 0.1).backward.margin < 0
    )  # the friction circle holds it anywhere


@pytest.mark.parametrize("name", ELEMENTS)
def test_gradients(name: str):
    """Forward and reverse mode against central differences, for every number of every element."""
    function, given = ELEMENTS[name]
    keys = list(given)
    base = jnp.asarray(list(given.values()))

    def all_of(x: jax.Array) -> jax.Array:
        return jnp.stack(jax.tree.leaves(function(**{key: x[i] for i, key in enumerate(keys)})))

    forward, reverse = jax.jacfwd(all_of)(base), jax.jacrev(all_of)(base)
    np.testing.assert_allclose(forward, reverse, rtol=1e-13, atol=1e-13)
    assert np.all(np.isfinite(forward))
    for i, value in enumerate(base):
        h = 1e-6 * value
        step = jnp.zeros_like(base).at[i].set(h)
        difference = (all_of(base + step) - all_of(base - step)) / (2 * h)
        np.testing.assert_allclose(forward[:, i], difference, rtol=2e-8, atol=1e-7 * np.abs(difference).max())


def test_gradients_are_finite_where_it_locks():
    gradient = jax.grad(lambda angle: elements.wedge_press(angle, 0.1).forward.efficiency)(1.5)
    cam = jax.grad(lambda e: elements.gripping_cam(e, 0.05, 1.2, 0.1).backward.margin)(0.003)
    assert np.isfinite([gradient, cam]).all()


def test_many_at_once():
    angles = jnp.linspace(0.1, 1.2, 7)
    together = elements.wedge_press(angles, 0.1, 50.0)
    single = [elements.wedge_press(angle, 0.1, 50.0).forward.effort for angle in angles]
    np.testing.assert_allclose(together.forward.effort, single, rtol=1e-14)


def test_materials():
    assert elements.material_friction("steel-steel") == pytest.approx(0.10)
    assert elements.material_friction("Bronze-Steel", lubricated=True) == pytest.approx(0.07)
    assert elements.material_friction("steel-cast iron", static=True) == pytest.approx(0.25)
    assert elements.groove_friction(0.1, 30 * DEG) == pytest.approx(0.2, rel=1e-14)
    assert elements.seat_friction(0.1, 1.2) == pytest.approx(0.12, rel=1e-14)
    for material, row in elements.MATERIALS.items():
        for i, value in enumerate(row):
            if value is None:
                with pytest.raises(ValueError, match="give friction as a number"):
                    elements.material_friction(material, lubricated=bool(i % 2), static=i < 2)
            else:
                assert value[0] <= elements.material_friction(material, lubricated=i % 2 == 1, static=i < 2) <= value[1]


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: elements.slider(0.0, 0.1), "angle of the slider is 0.0 rad; write an angle above 0 and below 90"),
        (lambda: elements.incline(0.3, -0.1), "friction of the incline is -0.1; write a finite number of zero or more"),
        (lambda: elements.wedge_press(0.3, math.nan), "friction of the wedge press is nan"),
        (lambda: elements.screw(0.02, 0.0, 0.1), "lead of the screw is 0.0; write a finite number above zero"),
        (lambda: elements.screw(0.02, 0.005, 0.1, flank=2.0), "flank of the screw is 2.0"),
        (lambda: elements.thrust_ring(0.01, 0.1, inner=0.02), "inner of the thrust ring is 0.02; write a radius below"),
        (lambda: elements.journal(0.01, 0.1, bearing="new"), "bearing of the journal is 'new'; write one of 'given'"),
        (lambda: elements.thrust_ring(0.01, 0.1, bearing="old"), "bearing of the thrust ring is 'old'; write one of"),
        (lambda: elements.seat_friction(0.1, 2.0), "factor of the curved seat is 2.0; write a number from 1 to"),
        (
            lambda: elements.material_friction("steel-wood"),
            "'steel-wood' is not in the table; write one of steel-steel",
        ),
        (lambda: elements.journal("0.1 m", 0.1), "where a number is needed"),
    ],
)
def test_bad_input(call, match: str):
    with pytest.raises((ValueError, TypeError), match=match):
        call()
