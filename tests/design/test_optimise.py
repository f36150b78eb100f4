"""Optimisation against known optima: closed forms, a fine scan."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import Case, Counterweight, DesignError, Variable, Vec, at_least, at_most
from linkjax._compile import compiled_soon
from linkjax.design import as_rows
from linkjax.design._needs import rows_for
from linkjax.design._problem import outputs
from linkjax.measures import (
    delta,
    flywheel_for_target_delta,
    max_crank_speed,
    min_inertia_ratio,
    min_margin,
    min_transmission_angle,
    peak_reaction_constant_speed,
    peak_shaking_force_constant_speed,
    rms_shaking_force_constant_speed,
    steady_state_margin,
)
from linkjax.motion import every_row


def rotor(speed: float = 20.0) -> lj.Scene:
    """An eccentric crank with a position for a counterweight: 2 kg at 30 mm and 10 mm."""
    link = lj.Link(length=0.1, mass=2.0, inertia=0.01, centre=Vec(0.03, 0.01),
                   counterweights={"W": Counterweight(1.0, Vec(0.0, 0.0), inertia=0.0)})  # fmt: skip
    mechanism = lj.Mechanism({"O": Vec(0.0, 0.0)}, {"crank": link}, [lj.Crank("crank", "O", "A")], lj.Flywheel(1.0))
    return lj.Scene(mechanism, speed=speed)


AT = "links.crank.counterweights.W.at"


def test_a_rotor_is_balanced():
    """1 kg opposite at twice the distance; with tighter bounds the remainder is m r ω² of the unreachable part."""
    free = {f"{AT}.along": (-0.1, 0.1), f"{AT}.across": (-0.1, 0.1)}
    found = lj.optimise(rotor(), free, peak_shaking_force_constant_speed, starts=3)
    assert found.feasible
    assert found.starts_at_optimum == 3
    assert found.objective_before == pytest.approx(2 * np.hypot(0.03, 0.01) * 400, rel=1e-9)
    assert found.objective < 1e-6 * found.objective_before
    np.testing.assert_allclose(found.x, [-0.06, -0.02], rtol=0, atol=1e-8)
    short = lj.optimise(rotor(), {f"{AT}.along": (-0.05, 0.1), f"{AT}.across": (-0.1, 0.1)},
                        peak_shaking_force_constant_speed)  # fmt: skip
    assert short.objective == pytest.approx(0.01 * 400, rel=1e-7)
    np.testing.assert_allclose(short.x, [-0.05, -0.02], rtol=0, atol=1e-6)
    assert short.kkt_residual < 1e-6
    assert short.bound_multiplier[f"{AT}.along"] == pytest.approx(400.0, rel=1e-4)  # N per m of the bound: m ω²


@pytest.mark.slow
def test_multipliers_are_prices():
    """Smallest flywheel for a constraint on δ: exactly known, and the multiplier of the constraint by differences."""

    def wheel(scene):
        return scene.mechanism.flywheel.inertia

    scene = lj.load("slider-crank")
    bound = 0.02
    found = lj.optimise(scene, {"flywheel.inertia": (0.0, 50.0)}, wheel, limits=[at_most(delta, bound)])
    assert found.feasible
    assert found.objective == pytest.approx(float(lj.flywheel_for(scene, bound)), rel=1e-7)
    low, high = (float(lj.flywheel_for(scene, bound + h)) for h in (-1e-6, 1e-6))
    assert found.limits["delta"].multiplier == pytest.approx((low - high) / 2e-6, rel=1e-4)
    assert float(delta(found.after)) == pytest.approx(bound, rel=1e-8)


def test_worst_of_several_cases():
    """Two speeds: the faster one is decisive, and both are listed."""
    free = {f"{AT}.along": (-0.05, 0.1), f"{AT}.across": (-0.1, 0.1)}
    cases = [Case("slow", {"speed": 10.0}), Case("fast", {"speed": 30.0})]
    found = lj.optimise(rotor(), free, peak_shaking_force_constant_speed, cases=cases)
    assert found.objective == pytest.approx(0.01 * 900, rel=1e-7)
    assert {"min_margin (slow)", "min_margin (fast)"} <= found.limits.keys()


def test_maximise_and_tie():
    """The largest assembly margin of a four-bar, coupler and rocker in constant proportion; against a scan."""
    scene = lj.load("four-bar")
    base = float(scene.mechanism.links["coupler"].length)
    free = [Variable("links.coupler.length", 0.8 * base, 1.2 * base, linked=("links.rocker.length",))]
    found = lj.optimise(scene, free, maximise=min_margin, starts=2)
    problem = found.problem
    values = jax.jit(jax.vmap(lambda x: min_margin(problem.design(x[None]))))
    at, step = base, 0.2 * base
    for _ in range(4):  # a scan, and finer ones around its best point
        around = jnp.clip(jnp.linspace(at - step, at + step, 401), 0.8 * base, 1.2 * base)
        at, step = float(around[jnp.argmax(values(around))]), step / 100
    best = float(values(jnp.full(1, at))[0])
    assert found.objective == pytest.approx(best, rel=1e-7)
    lengths = [found.after.mechanism.links[n].length / scene.mechanism.links[n].length for n in ("coupler", "rocker")]
    assert float(lengths[0]) == pytest.approx(float(lengths[1]), rel=1e-14)


@pytest.mark.slow
def test_no_feasible_design():
    """δ and the flywheel conflict, and are named; the result has the smallest violation."""

    def wheel(scene):
        return scene.mechanism.flywheel.inertia

    found = lj.optimise(lj.load("slider-crank"), {"flywheel.inertia": (0.0, 50.0)}, wheel,
                        limits=[at_most(delta, 1e-4), at_most(wheel, 0.01, name="flywheel")])  # fmt: skip
    assert not found.feasible
    assert set(found.conflicts) == {"delta", "flywheel"}


@pytest.mark.slow
def test_lost_machines_are_led_back():
    """Most of the starts cannot be assembled; all end assembled, none raises."""
    scene = lj.load("four-bar")
    free = {f"links.{n}.length": (0.02, 0.6) for n in ("coupler", "rocker")}
    found = lj.optimise(scene, free, maximise=min_transmission_angle, starts=6, seed=3)
    rng, problem = np.random.default_rng(3), found.problem
    begin = [problem.lower + rng.random(2) * (problem.upper - problem.lower) for _ in range(5)]
    assert sum(float(min_margin(problem.design(x))) < 0 for x in begin) >= 3
    assert all(start.feasible for start in found.starts)
    assert found.limits["min_margin"].value >= 1e-3 * (1 - 1e-6)
    assert np.isfinite([start.objective for start in found.starts]).all()


def test_compiled_once():
    """One program for a problem, for any number of starts."""
    free = {f"{AT}.along": (-0.1, 0.1), f"{AT}.across": (-0.1, 0.1)}
    before = set(outputs.programs)
    found = lj.optimise(rotor(), free, peak_shaking_force_constant_speed, nodes=40, starts=4)
    assert len(set(outputs.programs) - before) == 1
    assert found.evaluations > 4


def test_today_and_own_functions():
    """A constraint relative to the initial value; a user-defined function with several rows is bounded row by row."""
    scene = rotor()

    def places(scene):
        at = scene.mechanism.links["crank"].counterweights["W"].at
        return jnp.stack([at.x, at.y, -at.x - at.y])

    free = {f"{AT}.along": (-0.1, 0.1), f"{AT}.across": (-0.1, 0.1)}
    today = at_most(peak_shaking_force_constant_speed, "initial")
    found = lj.optimise(scene, free, as_rows(places), limits=[today])
    # the largest of x, y and -x - y has its minimum, zero, only where all vanish
    assert found.objective == pytest.approx(0.0, abs=1e-7)
    bound = found.limits["peak_shaking_force_constant_speed"].bound
    assert bound == pytest.approx(float(peak_shaking_force_constant_speed(scene)), rel=1e-12)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"free": {}}, "there is no design variable"),
        ({"free": {"speed": (2.0, 1.0)}}, "give two finite bounds"),
        ({"free": {"sped": (1.0, 2.0)}}, "did you mean 'speed'"),
        ({"free": [Variable("speed", 1.0, 2.0), Variable("speed", 1.0, 3.0)]}, "is freed twice"),
        ({"minimise": None}, "give either minimise or maximise"),
        ({"starts": 0}, "an integer of at least 1"),
        ({"free": [Variable(f"{AT}.along", 0.0, 2.0, linked=("speed",))]}, "has no ratio to it"),
    ],
)
def test_what_cannot_be_asked(change, says):
    asked = {"free": {"speed": (1.0, 2.0)}, "minimise": delta, **change}
    with pytest.raises(DesignError, match=says):
        lj.optimise(rotor(), asked.pop("free"), asked.pop("minimise"), **asked)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "one"),
    [
        ("slider-crank", peak_shaking_force_constant_speed),
        *(
            pytest.param("slider-crank", one, marks=pytest.mark.slow)
            for one in (max_crank_speed, peak_reaction_constant_speed, delta, steady_state_margin)
        ),
        pytest.param("slider-crank", flywheel_for_target_delta, marks=pytest.mark.slow),
        pytest.param("hay-press", min_inertia_ratio, marks=pytest.mark.slow),
        pytest.param("slider-crank", rms_shaking_force_constant_speed, marks=pytest.mark.slow),
        *(
            pytest.param("four-bar", one, marks=pytest.mark.slow)
            for one in (peak_reaction_constant_speed, delta, flywheel_for_target_delta)
        ),
    ],
)
def test_rows_hold_the_peak(name, one):
    """All candidates for the maximum or minimum: the first row is the measure itself, with the same slope."""
    scene, made = lj.load(name), one.rows
    assert made is not None

    def both(scene):
        parts = lj.measures.Parts(scene)
        return every_row([made(parts)])[0], one.function(parts)

    def numbers(shares):
        leaves, tree = jax.tree.flatten(scene)
        moved = [leaf + jnp.where(leaf == 0, 1.0, leaf) * by for leaf, by in zip(leaves, shares, strict=True)]
        rows, exact = both(jax.tree.unflatten(tree, moved))
        return (rows.size(), exact), (rows, exact)

    shares = [jnp.zeros(())] * len(jax.tree.leaves(scene))
    slopes, (rows, exact) = compiled_soon(jax.jacfwd(numbers, has_aux=True))(shares)
    assert one is rms_shaking_force_constant_speed or np.isfinite(rows.angle).all()
    sizes = np.asarray(rows.size())
    first = np.argmin(sizes) if one.smallest else np.argmax(sizes)
    assert sizes[first] == pytest.approx(float(exact), rel=1e-10)
    each, whole = (np.stack(part) for part in slopes)
    np.testing.assert_allclose(each[:, first], whole, rtol=0, atol=1e-8 * np.max(np.abs(whole)))


@pytest.mark.slow
def test_root_mean_square():
    """Against the forces of an analysis at equal steps, whose mean is exact for smooth periodic functions."""
    scene = lj.load("slider-crank")
    force = lj.analyse(scene, angles=180).forces_constant_speed.shaking
    rms = float(compiled_soon(rms_shaking_force_constant_speed)(scene))
    assert rms == pytest.approx(float(np.sqrt(np.mean(force.fx**2 + force.fy**2))), rel=1e-10)


def test_every_extreme_has_rows():
    """A measure that is the largest or smallest of several numbers has a kink where two of them are equal; a length has
    one where it vanishes."""
    assert {name for name, each in lj.measures.MEASURES.items() if each.rows is None} == {
        "energy_per_cycle",
        "mean_drive_torque",
        "mean_drive_power",
    }


def test_rows_only_where_the_sense_is_theirs():
    """`at_least` on a measure with peaks is one number; on the smallest of several, each; and vice versa."""
    asked = [limit(one, 0.1) for one in (peak_shaking_force_constant_speed, min_margin)
             for limit in (at_most, at_least)]  # fmt: skip
    scene = lj.load("four-bar")
    found = jax.eval_shape(lambda scene: rows_for(asked, lj.measures.Parts(scene, 32)), scene)
    force, one_force, one_margin, margins = (rows.vectors.shape for rows, _ in found)
    assert force[0] > 32 and force[1] == 2
    assert one_force == one_margin == (1, 1)
    assert margins == (2, 1)  # a dyad has two singular positions


@pytest.mark.slow
def test_tied_speeds():
    """Seven lengths against δ: two speed maxima are equal at the optimum, which a search on δ itself never reaches."""
    press = lj.load("hay-press", {"flywheel.inertia": "10 kg m^2"})
    free = {f"links.{name}.length": "± 8 %" for name in ("rod", "link4", "rocker")}
    free |= {"fixed.F.x": "± 5 %", "fixed.F.y": "± 5 %"}
    free |= {f"links.rod.points.E.{part}": "± 20 %" for part in ("along", "across")}
    found = lj.optimise(press, free, "delta", starts=3, seed=1)
    assert all(start.residual <= 1e-6 for start in found.starts)
    assert found.objective < 0.8 * found.objective_before
    assert float(delta(found.after, 160)) == pytest.approx(found.objective, rel=1e-8)
    assert found.evaluations < 100
