"""Machines at the limits: change points, zero masses, no loads, a crank alone, several turns, adjacent windows."""

from __future__ import annotations

import dataclasses
import json
import math
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import root_scalar

import linkjax as lj
from linkjax import RRP, RRR, Crank, Flywheel, Force, Link, Mechanism, Torque, Vec, Window
from linkjax._compile import compiled_soon
from linkjax.analysis import document, plain
from linkjax.motion import steady_motion
from tests.physics import oracle, shooting
from tests.physics.machines import machine

slopes = compiled_soon(jax.grad(lambda m, scene: steady_motion(scene.with_mechanism(m)).delta))


def four_bar(crank: float, coupler: float, rocker: float, frame: float, mass: float = 1.0, wheel: float = 1.0):
    links = {
        name: Link(length=length, mass=mass, inertia=0.01 * mass, centre=Vec(0.5 * length, 0.02))
        for name, length in (("crank", crank), ("coupler", coupler), ("rocker", rocker))
    }
    groups = [Crank("crank", "A", "B"), RRR(("coupler", "rocker"), "B", "D", "C", 1)]
    return Mechanism({"A": Vec(0.0, 0.0), "D": Vec(frame, 0.0)}, links, groups, Flywheel(wheel))


def crank_slider(ram: float) -> Mechanism:
    """Central, and only the ram has mass."""
    links = {"crank": Link(length=0.1), "rod": Link(length=0.3), "ram": Link(mass=ram)}
    groups = [Crank("crank", "A", "B"), RRP("rod", "ram", "B", "D", "A", 1)]
    return Mechanism({"A": Vec(0.0, 0.0)}, links, groups, Flywheel(0.0))


def crank_alone() -> Mechanism:
    return Mechanism({"A": Vec(0.0, 0.0)}, {"crank": Link(length=0.1, inertia=0.6)}, [Crank("crank", "A", "B")])


def window(on: float, off: float) -> Window:
    return Window(math.radians(on), math.radians(off))


def told(scene: lj.Scene) -> lj.analysis.Cycle:
    """An analysis that does not raise: every number finite, and the document can be written."""
    cycle = lj.analyse(scene, throw=False)
    for path, leaf in jax.tree_util.tree_leaves_with_path(cycle):
        single = jax.tree_util.keystr(path).endswith(".tied")  # NaN without an equal peak
        if jnp.issubdtype(jnp.asarray(leaf).dtype, jnp.floating) and not single:
            assert not np.any(np.isnan(np.asarray(leaf))), jax.tree_util.keystr(path)
    json.dumps(plain(document(cycle, "hard", "0")), allow_nan=False)
    return cycle


def finite_gradient(scene: lj.Scene):
    found = slopes(scene.mechanism, scene)
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(found))


@pytest.mark.slow
@pytest.mark.parametrize("lengths", [pytest.param((0.1, 0.4, 0.1, 0.4), id="parallelogram"),
                                     pytest.param((0.1, 0.1, 0.4, 0.4), id="kite")])  # fmt: skip
def test_change_points(lengths):
    """The two assembly modes coincide: reported with the position, and nothing is NaN."""
    scene = lj.Scene(four_bar(*lengths), gravity=Vec(0.0, -9.81), speed=10.0)
    cycle = told(scene)
    assert lj.Result(int(cycle.result)) is lj.Result.CANNOT_BE_ASSEMBLED
    with pytest.raises(lj.MachineError, match=r"'coupler-rocker' has a change point at 0\.00 degrees .*folded"):
        lj.analyse(scene)
    finite_gradient(scene)


def test_a_parallelogram_between_its_change_points():
    """With the pin to the left of the line of the outer pins it is a parallelogram in the upper half turn, where the
    rocker turns with the crank, and crossed in the lower half turn, where it turns against the crank."""
    links = jax.vmap(lambda phi: lj.pose(four_bar(0.1, 0.4, 0.1, 0.4), phi).links)
    upper, lower = links(jnp.linspace(0.1, 3.0, 9)), links(jnp.linspace(3.3, 6.1, 9))
    np.testing.assert_allclose(upper["rocker"].w, 1.0, rtol=1e-12)
    np.testing.assert_allclose(upper["coupler"].w, 0.0, atol=1e-12)
    phi = np.linspace(3.3, 6.1, 9)
    # crossed, the tangents of the half angles have a constant product, in proportion to (d - a) / (d + a) = 0.6
    slope = -0.6 / (0.36 * np.cos(phi / 2) ** 2 + np.sin(phi / 2) ** 2)
    np.testing.assert_allclose(lower["rocker"].w, slope, rtol=1e-10)


@pytest.mark.slow
def test_no_loads_at_all():
    """The kinetic energy is constant: ω = √(2 E / J), so δ follows from the extremes of J alone."""
    scene = lj.Scene(four_bar(0.1, 0.4, 0.3, 0.4), speed=10.0)
    got = told(scene)
    assert int(got.result) == 0
    assert abs(float(got.steady.mean_drive_torque)) < 1e-12
    phi = np.linspace(0.0, 2 * math.pi, 4000, endpoint=False)
    inertia = oracle.reduction(scene, phi).inertia

    def polished(sign):
        at = phi[np.argmax(sign * inertia)]
        return shooting.at(scene, root_scalar(lambda p: shooting.at(scene, p)[1], bracket=(at - 2e-3, at + 2e-3)).root)[
            0
        ]

    fast, slow = (1 / math.sqrt(polished(sign)) for sign in (-1, 1))
    mean = 1 / np.mean(np.sqrt(inertia))  # time mean: the period is the mean of √J
    assert float(got.delta) == pytest.approx((fast - slow) / mean, rel=1e-10)


@pytest.mark.slow
def test_a_crank_alone():
    """Constant speed, its torque balances the brake, and it can always be assembled."""
    scene = lj.Scene(crank_alone(), (Torque("brake", "crank", torque=-3.0),), speed=10.0)
    got = told(scene)
    assert int(got.result) == 0
    assert float(got.delta) < 1e-14
    assert float(got.steady.mean_drive_torque) == pytest.approx(3.0, rel=1e-14)
    finite_gradient(scene)


@pytest.mark.slow
def test_massless_links():
    """Rods without mass transmit forces like any others: SciPy's motion, the checks, and finite gradients."""
    scene = machine("hay-press-slider")
    for name in ("rod", "link4"):
        scene = eqx.tree_at(
            lambda s, n=name: (s.mechanism.links[n].mass, s.mechanism.links[n].inertia), scene, (jnp.zeros(()),) * 2
        )
    got = told(scene)
    assert int(got.result) == 0
    assert float(got.delta) == pytest.approx(shooting.shoot(scene).delta, rel=1e-8)
    assert max(float(check) for check in jax.tree.leaves(got.checks)) < 1e-10
    finite_gradient(scene)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mechanism", "where", "degrees"),
    [
        (four_bar(0.1, 0.4, 0.3, 0.4, 0.0, 0.0), "nothing has a mass", None),
        pytest.param(crank_slider(2.0), r"no reduced inertia at (\S+) degrees", (0.0, 180.0), marks=pytest.mark.slow),
    ],
)
def test_nothing_to_set_in_motion(mechanism, where, degrees):
    """Zero inertia everywhere, or where the ram stops: the speed is unbounded there, reported with the position,
    and all results that need no motion exist."""
    scene = lj.Scene(mechanism, (Torque("brake", "crank", torque=-3.0),), speed=10.0)
    cycle = told(scene)
    assert cycle.missing is not None and cycle.steady is None and cycle.forces is None and cycle.work is None
    found = re.search(where, cycle.missing.reason)
    assert found is not None and "Give the crank or the flywheel an inertia." in cycle.missing.reason
    assert lj.Result(int(cycle.result)) is (lj.Result.SUCCESS if degrees is None else lj.Result.NO_INERTIA)
    assert cycle.missing.fails == (degrees is not None)
    if degrees is not None:
        assert min(abs(math.remainder(float(found[1]) - d, 360.0)) for d in degrees) < 0.01
    mean = jnp.mean(cycle.forces_constant_speed.drive_torque)  # against the brake; masses absorb and return energy
    assert float(mean) == pytest.approx(3.0, rel=1e-9)
    with pytest.raises(lj.MachineError, match=r"Use forces_constant_speed\.reactions"):
        _ = cycle.reactions
    finite_gradient(scene)


@pytest.mark.slow
def test_gradients_where_there_is_no_steady_motion():
    """Of the results at constant speed, through the whole analysis: against differences, and the same under jit."""
    scene = lj.Scene(four_bar(0.1, 0.4, 0.3, 0.4, 0.0, 0.0), (), lj.Vec(0.0, -9.81), 1.0)

    def peak(mass):
        links = {**scene.mechanism.links, "coupler": dataclasses.replace(scene.mechanism.links["coupler"], mass=mass)}
        made = scene.with_mechanism(dataclasses.replace(scene.mechanism, links=links))
        return lj.analyse(made, angles=4, throw=False).peaks_constant_speed.value[0]

    slope = float(jax.grad(peak)(jnp.asarray(1.0)))
    assert slope == pytest.approx(float(peak(jnp.asarray(1.001)) - peak(jnp.asarray(0.999))) / 0.002, rel=1e-8)
    assert slope == pytest.approx(float(jax.jit(jax.grad(peak))(jnp.asarray(1.0))), rel=1e-12)


@pytest.mark.parametrize("short", [1e-3, 1e-6])
def test_least_inertia_beside_a_sharp_peak(short):
    """A heavy rocker that jerks near a change point: the minimum inertia, over its mean, is that of the machine at the
    reported angle, by the kinetic energy at unit speed."""
    mechanism = four_bar(0.1, 0.3, 0.2 * (1 + short), 0.4)
    rocker = dataclasses.replace(mechanism.links["rocker"], inertia=1.0)
    scene = lj.Scene(dataclasses.replace(mechanism, links={**mechanism.links, "rocker": rocker}), (), speed=5.0)
    found = compiled_soon(steady_motion)(scene)

    def inertia(angles):
        here = jax.vmap(lambda phi: lj.kinematics.pose(scene.mechanism, phi))(jnp.asarray(angles))
        total = 1.0
        for name, body in scene.mechanism.links.items():
            state, centre = here.links[name], here.points[body.centre_name]
            total += body.mass * (centre.dr.x**2 + centre.dr.y**2) + body.inertia * state.w**2
        return np.asarray(total)

    mean = np.mean(inertia(np.linspace(0.0, 2 * np.pi, 20000, endpoint=False)))
    (there,) = inertia([found.angle_of_min_inertia])
    assert float(found.min_inertia_ratio) * mean == pytest.approx(there, rel=1e-3)


@pytest.mark.slow
def test_two_turns_a_cycle():
    """A load in every second turn, against SciPy; as accurate as one turn, because nodes are counted per turn."""
    scene = machine("hay-press-slider")
    load = dataclasses.replace(scene.loads[0], window=window(90.0, 335.0 + 180.0))
    scene = dataclasses.replace(scene, cycle_turns=2, loads=(load,))
    got, known = compiled_soon(steady_motion)(scene), shooting.shoot(scene)
    wrong = abs(float(got.delta) - known.delta)
    assert wrong < 1e-8
    assert wrong <= float(got.delta_error) + 1e-11
    assert float(got.period) == pytest.approx(4 * math.pi / float(scene.speed), rel=1e-12)
    assert float(got.mean_drive_torque) == pytest.approx(known.drive, rel=1e-8)
    assert abs(math.remainder(float(got.angle_of_min) - known.slowest[1], 4 * math.pi)) < 1e-6


@pytest.mark.slow
def test_an_analysis_of_two_turns():
    """The stroke of an in-line slider, in either turn."""
    scene = dataclasses.replace(machine("hay-press-slider"), cycle_turns=2)
    stroke = document(lj.analyse(scene))["strokes"]["D"]
    assert (stroke["value"], stroke["time_ratio"]) == pytest.approx((0.6, 1.0), rel=1e-12)


@pytest.mark.slow
def test_windows_that_touch():
    """Loads that switch at the same angles, one on where another ends, are equivalent to one load of varying size."""
    scene = machine("hay-press-slider")
    press = scene.loads[0]

    def torque(name, size, *ends):
        return Torque(name, "crank", torque=size, window=window(*ends) if ends else None)

    split = (press, torque("one", -20.0, 90.0, 335.0), torque("two", -10.0, 335.0, 90.0))
    whole = (press, torque("more", -10.0, 90.0, 335.0), torque("always", -10.0))
    one, two = (compiled_soon(steady_motion)(dataclasses.replace(scene, loads=loads)) for loads in (split, whole))
    assert abs(float(one.delta - two.delta)) <= float(one.delta_error + two.delta_error)
    assert float(one.delta) == pytest.approx(float(two.delta), rel=1e-7)
    assert float(one.mean_drive_torque) == pytest.approx(float(two.mean_drive_torque), rel=1e-9)


@pytest.mark.slow
def test_a_window_without_width():
    """It cannot be written, but a search may close it: then it never acts, as if the load did not exist."""
    scene = machine("hay-press-slider")
    with pytest.raises(lj.StructureError, match=r"loads\[0\] \(hay\).* window start and end coincide"):
        dataclasses.replace(scene, loads=(dataclasses.replace(scene.loads[0], window=window(90.0, 90.0)),))
    closed = eqx.tree_at(lambda s: s.loads[0].window, scene, window(90.0, 90.0))
    without = dataclasses.replace(scene, loads=(Force("none", "slider", "D", force=Vec(0.0, 0.0)),))
    one, two = (compiled_soon(steady_motion)(s) for s in (closed, without))
    assert abs(float(one.delta - two.delta)) <= float(one.delta_error + two.delta_error)
