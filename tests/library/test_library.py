# pyright: reportArgumentType=false
"""Machines by name, against closed forms."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Link, Vec
from linkjax._compile import compiled_soon
from linkjax.kinematics import pose
from tests.library.examples import MADE, scene

PHI = np.linspace(0.0, 2 * math.pi, 25)[:-1]
EXACT = {"rtol": 0, "atol": 1e-15}
poses = compiled_soon(lambda mechanism: jax.vmap(lambda phi: pose(mechanism, phi))(jnp.asarray(PHI)))


def places(mechanism) -> dict[str, np.ndarray]:
    """Points over the turn, as complex numbers."""
    return {name: np.asarray(p.r.x) + 1j * np.asarray(p.r.y) for name, p in poses(mechanism).points.items()}


@pytest.mark.parametrize(("side", "turns"), [(1, 1), (-1, -1)])
def test_four_bar(side, turns):
    """Freudenstein's equation: K1 cos ψ − K2 cos φ + K3 = cos(φ − ψ)."""
    a, b, c, d = 0.1, 0.35, 0.25, 0.38
    at = places(lj.four_bar(a, b, c, d, side=side, rotation="ccw" if turns > 0 else "cw"))
    np.testing.assert_allclose(at["B"], a * np.exp(1j * turns * PHI), **EXACT)
    phi, psi = turns * PHI, np.angle(at["C"] - at["D"])
    k1, k2, k3 = d / a, d / c, (a**2 - b**2 + c**2 + d**2) / (2 * a * c)
    np.testing.assert_allclose(k1 * np.cos(psi) - k2 * np.cos(phi) + k3, np.cos(phi - psi), rtol=0, atol=2e-14)
    np.testing.assert_allclose(np.abs(at["C"] - at["D"]), c, rtol=1e-14)
    assert np.all(side * ((at["C"] - at["B"]) / (at["D"] - at["B"])).imag > 0)


@pytest.mark.parametrize(("offset", "side"), [(0.0, 1), (0.03, 1), (-0.02, -1)])
def test_slider_crank(offset, side):
    """x = r cos φ ± √(l² − (r sin φ − e)²)."""
    at = places(lj.slider_crank(0.1, 0.3, offset, side=side))
    x = 0.1 * np.cos(PHI) + side * np.sqrt(0.3**2 - (0.1 * np.sin(PHI) - offset) ** 2)
    np.testing.assert_allclose(at["D"], x + 1j * offset, **EXACT)


def test_scotch_yoke():
    at = places(lj.scotch_yoke(0.08))
    np.testing.assert_allclose(at["E"], 0.08 * np.cos(PHI), **EXACT)


@pytest.mark.parametrize(("r", "d", "length", "rod", "h", "side"), [(0.12, 0.35, 0.75, 0.3, 0.37, -1),
                                                                    (0.2, 0.08, 0.15, 0.5, 0.02, 1)])  # fmt: skip
def test_quick_return(r, d, length, rod, h, side):
    """The lever points from P to the crank pin; the ram is a rod's reach from its end. A lever that swings turns round
    where the crank is square to it, sin φ = −r / d."""
    mechanism = lj.quick_return(r, d, length, rod, h, side=side)
    at = places(mechanism)
    end = -1j * d + length * np.exp(1j * np.angle(1j * d + r * np.exp(1j * PHI)))
    np.testing.assert_allclose(at["E"], end, **EXACT)
    np.testing.assert_allclose(at["R"], end.real + side * np.sqrt(rod**2 - (h - end.imag) ** 2) + 1j * h, **EXACT)
    if r < d:
        for phi in (math.pi + math.asin(r / d), 2 * math.pi - math.asin(r / d)):
            assert float(pose(mechanism, jnp.asarray(phi)).links["lever"].w) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("side", [1, -1])
def test_toggle_press(side):
    """The knee C by the law of cosines, the ram below D by Pythagoras."""
    r, rod, upper, lower, pivot = 0.06, 0.4, 0.3, 0.32, 0.35 + 0.3j
    at = places(lj.toggle_press(r, rod, upper, lower, (pivot.real, pivot.imag), side=side))
    span = pivot - r * np.exp(1j * PHI)
    corner = np.arccos((rod**2 + np.abs(span) ** 2 - upper**2) / (2 * rod * np.abs(span)))
    knee = r * np.exp(1j * PHI) + rod * np.exp(1j * (np.angle(span) + side * corner))
    np.testing.assert_allclose(at["C"], knee, **EXACT)
    ram = pivot.real + 1j * (knee.imag - np.sqrt(lower**2 - (knee.real - pivot.real) ** 2))
    np.testing.assert_allclose(at["E"], ram, **EXACT)


@pytest.mark.parametrize("kind", ["watt-1", "watt-2", "stephenson-1", "stephenson-3"])
def test_six_bar(kind):
    """The four-bar is as it was alone; E and F are where they were put; G by the law of cosines."""
    mechanism = MADE[kind]()
    assert mechanism.formula() == "I1(crank) → II1(coupler, rocker) → II1(rod, lever)"
    rotation = "cw" if kind == "stephenson-1" else "ccw"
    at, alone = places(mechanism), places(lj.four_bar(0.1, 0.35, 0.25, 0.38, rotation=rotation))
    for point in "ABCD":
        np.testing.assert_array_equal(at[point], alone[point])
    u = {"crank": (at["A"], at["B"]), "coupler": (at["B"], at["C"]), "rocker": (at["D"], at["C"])}
    e, f, link_e, link_f, rod, lever, side = {
        "watt-1": (0.2 + 0.14j, 0.3 - 0.06j, "coupler", "rocker", 0.3, 0.28, 1),
        "watt-2": (0.2 - 0.1j, 0.75 + 0.1j, "rocker", "", 0.5, 0.3, 1),
        "stephenson-1": (0.05 + 0.06j, 0.1 - 0.1j, "crank", "rocker", 0.4, 0.3, 1),
        "stephenson-3": (0.2 + 0.14j, 0.45 + 0.4j, "coupler", "", 0.3, 0.26, -1),
    }[kind]
    for point, place, link in (("E", e, link_e), ("F", f, link_f)):
        wanted = place + 0 * PHI
        if link:
            first, last = u[link]
            wanted = first + place * (last - first) / np.abs(last - first)
        np.testing.assert_allclose(at[point], wanted, **EXACT)
    span = at["F"] - at["E"]
    corner = np.arccos((rod**2 + np.abs(span) ** 2 - lever**2) / (2 * rod * np.abs(span)))
    np.testing.assert_allclose(at["G"], at["E"] + rod * np.exp(1j * (np.angle(span) + side * corner)), atol=4e-15)


@pytest.mark.slow
@pytest.mark.parametrize("name", MADE)
def test_each_analyses(name):
    cycle = lj.analyse(scene(name), angles=12)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-9


def test_gradients_go_through():
    """dx/dr = cos φ − (r sin φ − e) sin φ / √…, dx/de = (r sin φ − e) / √…"""

    def x(crank, offset):
        return pose(lj.slider_crank(crank, 0.3, offset), jnp.asarray(0.7)).points["D"].r.x

    by_crank, by_offset = jax.grad(x, argnums=(0, 1))(0.1, 0.02)
    h = 0.1 * math.sin(0.7) - 0.02
    root = math.sqrt(0.3**2 - h**2)
    assert float(by_crank) == pytest.approx(math.cos(0.7) - h * math.sin(0.7) / root, rel=1e-13)
    assert float(by_offset) == pytest.approx(h / root, rel=1e-13)


def test_what_else_there_is_to_a_link():
    coupler = Link(mass=1.2, inertia=0.01, centre=Vec(0.2, 0.01), points={"T": Vec(0.1, 0.05)})
    made = lj.six_bar("watt-1", 0.1, 0.35, 0.25, 0.38, 0.3, 0.28, (0.2, 0.14), (0.3, -0.06), links={"coupler": coupler})
    assert set(made.links["coupler"].points) == {"E", "T"}
    assert float(made.links["coupler"].mass) == 1.2 and float(made.links["coupler"].length) == 0.35
    assert float(lj.four_bar(0.1, 0.35, 0.25, 0.38, flywheel=2.5).flywheel.inertia) == 2.5


NONE = (0.0, 0.0)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: lj.four_bar(-0.1, 0.3, 0.3, 0.3), "crank of a four_bar must be above zero, but is -0.1; give a leng"),
        (lambda: lj.four_bar(0.1, 0.3, 0.3, math.nan), "frame of a four_bar must be above zero, but is nan"),
        (lambda: lj.four_bar(0.1, 0.3, 0.3, 0.9), "frame of a four_bar is 0.9, but all others together are 0.7, so"),
        (lambda: lj.slider_crank(0.1, 0.2, 0.4), "offset of a slider_crank is 0.4, but crank and rod reach only"),
        (lambda: lj.scotch_yoke(0.0), "crank of a scotch_yoke must be above zero, but is 0;"),
        (lambda: lj.quick_return(0.1, 0.1, 0.3, 0.2, 0.1), "crank and distance of a quick_return are both 0.1, so th"),
        (lambda: lj.toggle_press(0.1, 0.2, 0.3, 0.3, (2.0, 0.0)), "pivot of a toggle_press is 2, but all others toge"),
        (lambda: lj.six_bar("stephenson-2", 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, NONE, NONE), "of class III or IV; build it"),
        (lambda: lj.six_bar("watt", 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, NONE, NONE), "six_bar is 'watt'; write one of watt-"),
        (lambda: lj.scissor_lift(2.0, 1.2, 0.2, 0.7), "eye of a scissor_lift is 1.2, but half a bar is 1; give its d"),
        (lambda: lj.scissor_lift(2.0, 0.5, 0.2, 0.7, pairs=3), "pairs of a scissor_lift must be 1 or 2, but is 3;"),
        (lambda: lj.scissor_lift(2.0, 0.5, 0.2, 0.7, base=(0.1, 2.0)), "cylinder of a scissor_lift is 1.746[0-9]* m"),
        (lambda: lj.scissor_lift(2.0, 0.5, 0.7, 0.2), "low and high of a scissor_lift are 0.7 and 0.2 rad; write inc"),
        (lambda: lj.scotch_yoke(0.1, links={"yok": Link()}), "it has no link 'yok'; did you mean 'yoke'"),
        (lambda: lj.scotch_yoke(0.1, links={"crank": Link(length=0.2)}), r"links\['crank'\] of a scotch_yoke has the"),
        (lambda: lj.four_bar(0.1, 0.3, 0.3, 0.3, side=0), "side of an RRR must be 1 or -1, but is 0"),
    ],
)  # fmt: skip
def test_what_cannot_be_built(make, says):
    with pytest.raises(ValueError, match=says):
        make()
