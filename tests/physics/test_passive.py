"""Redundant links: found where a chain moves despite too many joints, analysed, and their joints named."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import (
    RRR,
    Crank,
    Drive,
    Flywheel,
    Guide,
    Link,
    Mechanism,
    RedundantLink,
    RedundantSlider,
    Slot,
    StructureError,
    Vec,
    linkage,
)
from linkjax._compile import compiled_soon
from linkjax.analysis import document
from linkjax.forces import kinetostatics
from linkjax.friction import indeterminate
from linkjax.kinematics import margins, pose, prepared
from linkjax.mechanism import structure
from linkjax.scenes import loads_text, text_of

ANGLES = np.linspace(0.0, 2 * math.pi, 13)[:-1] + 0.1
LEAN = 0.3  # of the frame's line of pivots
ARM, LONG = 0.1, 0.4


def parallel(more: dict[str, float], off: float = 0.0, drawn: bool = True) -> Mechanism:
    """A parallelogram with additional cranks at these points along coupler and frame, too long by `off`."""
    links = {
        "crank": Link(length=ARM, mass=1.0, pins=("A", "B")),
        "coupler": Link(length=LONG, mass=2.0, inertia=0.02, centre=Vec(0.15, 0.01), pins=("B", "C", *more),
                        points={name: Vec(at, 0.05) for name, at in more.items()}),
        "rocker": Link(length=ARM, mass=1.0, centre=Vec(0.05, 0.0), pins=("D", "C")),
    }  # fmt: skip
    fixed = {"A": (0.0, 0.0), "D": (LONG * math.cos(LEAN), LONG * math.sin(LEAN))}
    turn, arm = complex(math.cos(LEAN), math.sin(LEAN)), ARM * complex(math.cos(1.0), math.sin(1.0))
    sketch = {}
    for name, at in {**more, "C": None}.items():
        foot = (LONG + 0j if at is None else at + 0.05j) * turn
        if at is not None:
            fixed[f"{name}0"] = (foot.real, foot.imag)
            links[f"crank{name}"] = Link(length=ARM + off, mass=1.5, inertia=0.01, centre=Vec(0.04, 0.01),
                                         pins=(f"{name}0", name))  # fmt: skip
        sketch[name] = ((foot + arm).real, (foot + arm).imag)
    return linkage(fixed, links, Drive("crank", phase=1.0), sketch=sketch, flywheel=Flywheel(0.5))


@pytest.mark.slow
def test_a_third_and_a_fourth_parallel_crank():
    """They are found, and have the same motion as the others."""
    for more in ({"F": 0.2}, {"F": 0.2, "G": 0.1}):
        mechanism = parallel(more)
        names = [f"crank{name}" for name in more]
        told = "; ".join(f"passive({name})" for name in names)
        told = told if len(names) == 1 else f"{{{told}}}"
        assert mechanism.formula() == f"I1(crank) → II1(coupler, rocker) → {told}"
        found, count = structure(mechanism), len(more)
        assert found.mobility == 1 - count
        assert found.mobility_formula() == f"W = 3 n - 2 p = 3·{3 + count} - 2·{4 + 2 * count} = {1 - count}"
        here = compiled_soon(lambda m: jax.vmap(lambda phi: pose(m, phi))(jnp.asarray(ANGLES)))(mechanism)
        for name in names:
            np.testing.assert_allclose(here.links[name].u.x, np.cos(1.0 + ANGLES), atol=1e-14)
            np.testing.assert_allclose(here.links[name].w, 1.0, rtol=1e-13)
            np.testing.assert_allclose(here.links[name].e, 0.0, atol=1e-12)


def test_forces_of_a_passive_crank():
    """It carries only its own weight and inertia: transverse to its axis by its moment, the rest at the frame; the
    drive torque is that of the energy balance of the whole machine; every joint that shares loads is named."""
    mechanism, g, speed = parallel({"F": 0.2}), 9.81, 12.0
    scene = lj.Scene(mechanism, (lj.OpposingTorque("brake", "rocker", magnitude=2.0),), Vec(0.0, -g), speed)
    three = jax.vmap(lambda phi: kinetostatics(scene, phi, jnp.asarray(speed), jnp.asarray(0.0)))
    found = compiled_soon(three)(jnp.asarray(ANGLES))
    u = np.exp(1j * (1.0 + ANGLES))
    load = -1.5j * g + 1.5 * complex(0.04, 0.01) * u * speed**2  # weight and inertia at the mass centre
    moment = ((complex(0.04, 0.01) * u).conjugate() * load).imag
    across = -1j * u * moment / ARM
    far, near = (found.reactions[joint]["crankF"] for joint in ("F", "F0"))
    np.testing.assert_allclose(np.asarray(far.fx) + 1j * np.asarray(far.fy), across, rtol=1e-11)
    np.testing.assert_allclose(np.asarray(near.fx) + 1j * np.asarray(near.fy), -load - across, rtol=1e-11)
    arms = [(1.0, 0.0), (2.0, ARM), (1.0, 0.05), (1.5, complex(0.04, 0.01))]  # vertical motion, driven by the crank
    rise = sum(m * (1j * arm * u).imag for m, arm in arms)
    np.testing.assert_allclose(found.drive_torque, g * rise + 2.0, rtol=1e-11)
    assert set(indeterminate(mechanism)) == {"A", "B", "C", "D", "F", "F0"}


def press() -> Mechanism:
    """A ram in its guide, and a shoe of it in a parallel guide."""
    links = {
        "crank": Link(length=0.1, mass=1.0, pins=("A", "B")), "rod": Link(length=0.4, mass=2.0, pins=("B", "U")),
        "ram": Link(mass=3.0, points={"K": Vec(0.1, 0.05)}, pins=("U", "K")), "shoe": Link(mass=0.2, pins=("K",)),
    }  # fmt: skip
    slots = [Slot("ram", Guide("A", 0.2)), Slot("shoe", Guide("H", 0.2))]
    turn = complex(math.cos(0.2), math.sin(0.2))
    fixed = {name: ((at * turn).real, (at * turn).imag) for name, at in (("A", 0j), ("H", 0.05j))}
    sketch = {name: ((at * turn).real, (at * turn).imag) for name, at in (("U", 0.5 + 0j), ("K", 0.6 + 0.05j))}
    return linkage(fixed, links, Drive("crank"), slots, sketch, Flywheel(1.0))


def test_a_doubled_guide():
    """The shoe is found; transverse force and couple of both guides are shared, and the pin between them."""
    mechanism = press()
    assert mechanism.formula() == "I1(crank) → II2(rod, ram) → passive(shoe)"
    assert set(indeterminate(mechanism)) == {"ram.guide", "shoe.guide", "K"}


@pytest.mark.slow
def test_an_analysis_names_what_is_shared():
    """In its document; energy and virtual power balance."""
    mechanism = press()
    cycle = lj.analyse(
        lj.Scene(mechanism, (lj.OpposingForce("cut", "ram", "U", magnitude=50.0),), speed=9.0), angles=36
    )
    assert float(cycle.checks.virtual_power) < 1e-12 and float(cycle.checks.energy_closure) < 1e-12
    shoe = cycle.reactions["shoe.guide"]["shoe"]
    assert float(jnp.max(shoe.magnitude)) == 0.0
    assert document(cycle)["model"]["indeterminate"] == list(indeterminate(mechanism))


def trammel() -> Mechanism:
    """Cardan's: a crank turns the middle of a bar, whose ends run in two guides at right angles."""
    links = {
        "crank": Link(length=0.15, mass=1.0, pins=("O", "M")),
        "bar": Link(length=0.3, mass=2.0, inertia=0.015, centre=Vec(0.15, 0.0), points={"M": Vec(0.15, 0.0)},
                    pins=("X", "Y", "M")),
        "along": Link(mass=6.0, pins=("X",)), "across": Link(mass=3.0, pins=("Y",)),
    }  # fmt: skip
    sketch = {"M": (0.075, 0.13), "X": (0.15, 0.0), "Y": (0.0, 0.26)}
    slots = [Slot("along", Guide("O")), Slot("across", Guide("O", math.pi / 2))]
    return linkage({"O": (0.0, 0.0)}, links, Drive("crank", phase=math.pi / 3), slots, sketch, Flywheel(1.0))


@pytest.mark.slow
def test_a_change_point_that_a_passive_link_passes():
    """At a change point of the rest only the redundant slider holds the bar: reactions are unbounded if it carries
    nothing, but drive torque and frame forces do not depend on it, and equal Newton's, also at this point."""
    mechanism, g, speed, grows = trammel(), 9.81, 12.0, jnp.asarray(-3.0)
    scene = lj.Scene(mechanism, (), Vec(0.0, -g), speed)
    phi = np.concatenate([np.radians([30.0, 210.0, 120.0]), np.pi / 6 + np.array([1e-9, -1e-6, 1e-4]), ANGLES])
    both = jax.vmap(lambda phi: kinetostatics(scene, phi, jnp.asarray(speed), grows))
    found = compiled_soon(both)(jnp.asarray(phi))
    c, s, a = np.cos(np.pi / 3 + phi), np.sin(np.pi / 3 + phi), 0.15
    fx = (2.0 + 2 * 6.0) * a * (c * speed**2 + s * grows)
    fy = (2.0 + 2 * 3.0) * a * (s * speed**2 - c * grows)
    inertia = 1.0 + 0.015 + 2.0 * a**2 + 4 * a**2 * (6.0 * s**2 + 3.0 * c**2)
    torque = inertia * grows + 4 * a**2 * (6.0 - 3.0) * s * c * speed**2 + g * a * c * (2.0 + 2 * 3.0)
    np.testing.assert_allclose(found.drive_torque, torque, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.frame.fx, fx, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.frame.fy, fy - 12.0 * g, rtol=0, atol=1e-8)
    about = torque - (1.0 - 0.015 + 2.0 * a**2) * grows - g * a * c * (2.0 + 2 * 6.0)
    np.testing.assert_allclose(found.frame.moment, about, rtol=0, atol=1e-8)
    drive = jax.grad(lambda scene: kinetostatics(scene, jnp.asarray(np.pi / 6), scene.speed, grows).drive_torque)
    slopes = compiled_soon(drive)(scene)
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(slopes))
    assert float(slopes.mechanism.links["along"].mass) == pytest.approx(4 * a**2 * float(grows), abs=1e-9)


@pytest.mark.slow
def test_an_analysis_through_such_a_point():
    """Only results that depend on the redundant link are omitted there."""
    scene = lj.Scene(trammel(), (lj.OpposingForce("pen", "bar", "X", magnitude=5.0),), Vec(0.0, -9.81), 6.0)
    cycle = lj.analyse(scene, angles=36)
    assert float(cycle.checks.virtual_power) < 1e-11 and float(cycle.checks.force_balance) < 1e-11
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(cycle.forces._replace(reactions={})))
    lost = np.isnan(np.asarray(cycle.reactions["X"]["bar"].fx))
    assert list(np.flatnonzero(lost)) == [3, 21]
    at = dict(zip(lj.measures.peak_names(scene), cycle.peaks.value, strict=True))
    unbounded = {name.split(".")[1] for name, value in at.items() if np.isinf(value)}
    assert unbounded == {"O", "M", "X", "along"} and {"O", "M", "X", "along.guide"} < set(
        indeterminate(scene.mechanism)
    )


def test_nothing_is_shared_in_a_plain_machine():
    assert indeterminate(lj.load("slider-crank").mechanism) == ()


def test_what_does_not_fit_holds_fast():
    """With another length the chain cannot move, as given by its mobility."""
    told = r"'crankF' is 0.101 m long, but the motion of the other links puts its ends 0.1 m apart; give it"
    with pytest.raises(StructureError, match=rf"links.crankF: nothing can move \(W = .* 3·4 - 2·6 = 0\): {told}"):
        parallel({"F": 0.2}, off=1e-3)


@pytest.mark.slow
def test_a_misfit_is_told():
    """In groups the user marks redundant links: deviations of a millionth of the length are accepted, more are not."""
    links = {name: Link(length=long, mass=1.0, pins=()) for name, long in (("crank", 0.1), ("rod", 0.3), ("arm", 0.25))}
    links["rod"] = Link(length=0.3, mass=1.0, points={"F": Vec(0.3, 0.0)})

    def scene(length: float) -> lj.Scene:
        own = {**links, "tie": Link(length=length, mass=0.5)}
        groups = [Crank("crank", "A", "B"), RRR(("rod", "arm"), "B", "D", "C"), RedundantLink("tie", "D", "F")]
        return lj.Scene(Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.35, 0.0)}, own, groups, Flywheel(1.0)), (), speed=5.0)

    for off, value in ((0.0, 1.0), (1e-7, 1 - 1e-7 / (0.25 + 1e-7) / 1e-6)):
        here = margins(prepared(scene(0.25 + off).mechanism), jnp.asarray(1.0))["tie"]["fits"]
        assert float(here.value) == pytest.approx(value, abs=1e-8)
    with pytest.raises(
        lj.MachineError, match=r"group 'tie' does not fit: at .* degrees its error is 0.00398 of its length"
    ):
        lj.analyse(scene(0.251), angles=12)
    with pytest.raises(
        lj.MachineError, match=r"the distance of its pin from the guide is 0.0025 of the longest link\. "
    ):
        lj.analyse(guided(0.051), angles=12)
    with pytest.raises(ValueError, match="both ends of a redundant link are attached to the point 'D'"):
        RedundantLink("tie", "D", "D")


def guided(height: float) -> lj.Scene:
    """A slider-crank whose slider has a second guide at y = 0.05 m, at this distance from its first."""
    return lj.Scene(Mechanism(
        {"A": Vec(0.0, 0.0), "H": Vec(0.0, 0.05)},
        {"crank": Link(length=0.1, mass=1.0), "rod": Link(length=0.4, mass=2.0),
         "ram": Link(mass=3.0, points={"K": Vec(0.1, height)}), "shoe": Link(mass=0.2)},
        [Crank("crank", "A", "B"), lj.RRP("rod", "ram", "B", "U", Guide("A")),
         RedundantSlider("shoe", "K", Guide("H"))],
    ), (), speed=5.0)  # fmt: skip


@pytest.mark.slow
def test_written_and_read_back():
    """Drawn ones by their links and joints, others by their groups."""
    for mechanism in (parallel({"F": 0.2}), press(), guided(0.05).mechanism):
        scene = lj.Scene(mechanism, (), speed=5.0)
        again = loads_text(text_of(scene))
        assert jax.tree.structure(scene) == jax.tree.structure(again)
        for one, two in zip(jax.tree.leaves(scene), jax.tree.leaves(again), strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-15)
