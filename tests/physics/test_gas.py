"""Gas on a piston: work in closed form, the ends of the stroke, kinks, branches, derivatives."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import linkjax as lj
from linkjax.design import changed, numbers
from linkjax.machine import ready
from linkjax.motion import make_grid, steady_motion
from tests.helpers import assert_gradients_agree
from tests.physics.test_tables import TURN, L, R, height, share, with_loads, works

BORE, CLEARANCE, P1, P2, STROKE = 0.08, 2e-5, 1e5, 4e5, 2 * R
AREA = math.pi / 4 * BORE**2
MOST = CLEARANCE + AREA * STROKE


@pytest.fixture(scope="module")
def machine() -> lj.Scene:
    return lj.load("two-cylinder")


def compressor(exponent: Any = 1.3, **others: Any) -> lj.Gas:
    fields: dict[str, Any] = {
        "bore": BORE,
        "head": "+",
        "clearance": CLEARANCE,
        "pressure": lj.Polytropic(P1, P2, exponent),
    }
    return lj.Gas("air", "piston3", "D", **(fields | others))


def cycle_work(n: float, clearance: float = CLEARANCE) -> float:
    """n/(n-1) p₁ (V₁ - V₄) [(p₂/p₁)^((n-1)/n) - 1], the work of a cycle of a compressor; n = 1: p₁ (V₁ - V₄) ln."""
    filled = clearance + AREA * STROKE - clearance * (P2 / P1) ** (1 / n)
    if n == 1:
        return P1 * filled * math.log(P2 / P1)
    return n / (n - 1) * P1 * filled * ((P2 / P1) ** ((n - 1) / n) - 1)


@pytest.mark.parametrize("n", [1.3, 1.0, 1.4])
def test_a_compressor_takes_its_work_in_closed_form(machine, n):
    assert works(with_loads(machine, compressor(n)), 320)["air"] == pytest.approx(-cycle_work(n), rel=1e-9)


def test_ambient_and_the_side_of_the_head_make_no_work(machine):
    """The ambient pressure does none over a cycle; a head below is the same cycle, half a turn later."""
    one = works(with_loads(machine, compressor(ambient=0.0)), 320)["air"]
    two = works(with_loads(machine, compressor(head="-")), 320)["air"]
    assert one == pytest.approx(-cycle_work(1.3), rel=1e-9)
    assert two == pytest.approx(-cycle_work(1.3), rel=1e-9)


def test_pressure_over_the_cycle(machine):
    """Expansion from the top dead centre at 90 degrees, suction, compression from 270 degrees, delivery."""
    scene = with_loads(machine, compressor(ambient=P1))
    top = R + L
    for phi in np.radians([92.0, 100.0, 150.0, 200.0, 280.0, 330.0, 20.0, 60.0, 88.0]):
        volume = CLEARANCE + AREA * (top - height(phi)[0])
        grows = height(phi)[1] < 0
        p = max(P2 * (CLEARANCE / volume) ** 1.3, P1) if grows else min(P1 * (MOST / volume) ** 1.3, P2)
        assert share(scene, phi) == pytest.approx(-(p - P1) * AREA * height(phi)[1], rel=1e-10, abs=1e-9)


def test_panels_end_where_suction_and_delivery_begin(machine):
    edges = np.asarray(make_grid(with_loads(machine, compressor()), 96).edges) % TURN
    begins = {CLEARANCE * (P2 / P1) ** (1 / 1.3): True, MOST * (P1 / P2) ** (1 / 1.3): False}
    fine = np.linspace(0.0, TURN, 200001)
    for volume, grows in begins.items():
        beyond = CLEARANCE + AREA * (R + L - height(fine)[0]) - volume
        cells = np.flatnonzero((beyond[:-1] * beyond[1:] < 0) & ((beyond[1:] > beyond[:-1]) == grows))
        assert cells.size == 1
        assert np.min(np.abs(edges - fine[cells[0]])) < fine[1]
    for reversal in (math.pi / 2, 3 * math.pi / 2):
        assert np.min(np.abs(edges - reversal)) < 1e-12


def test_a_cylinder_that_never_draws_in(machine):
    """With much clearance the gas expands and is compressed along one curve: no work, and no jump."""
    scene = with_loads(machine, compressor(clearance=2e-3))
    assert abs(works(scene, 160)["air"]) < 1e-7
    top = AREA * P2
    load = scene.loads[0]
    assert isinstance(load, lj.Gas)
    before, after = (share(scene, 3 * math.pi / 2 + offset, 3 * math.pi / 2 + offset) / top for offset in (-1e-7, 1e-7))
    assert abs(before - after) < 1e-6


def test_the_ends_of_the_stroke_follow_the_design(machine):
    """The extremes are R + L and L - R above the crank, with their first and second derivatives."""

    def ends(lengths):
        scene = changed(
            with_loads(machine, compressor()), {"links.crank.length": lengths[0], "links.rod2.length": lengths[1]}
        )
        return jnp.stack(ready(scene).ends[0])

    at = jnp.asarray([R, L])
    np.testing.assert_allclose(ends(at), [L - R, L + R], rtol=1e-14)
    np.testing.assert_allclose(jax.jacfwd(ends)(at), [[-1.0, 1.0], [1.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(jax.jacrev(ends)(at), [[-1.0, 1.0], [1.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(jax.jacfwd(jax.jacrev(ends))(at), np.zeros((2, 2, 2)), atol=1e-10)


def test_a_diagram_over_the_volume_works_its_area(machine):
    volumes, going, coming = [2e-5, 1e-4, 3e-4, 7e-4], [30e5, 12e5, 5e5, 3e5], [18e5, 4e5, 2e5, 1e5]
    pressure = lj.Diagram(volumes, going, coming, by="volume")
    work = works(with_loads(machine, compressor(pressure=pressure)), 192)["air"]
    between = np.linspace(CLEARANCE, MOST, 400001)
    area = np.trapezoid(np.interp(between, volumes, going) - np.interp(between, volumes, coming), between)
    assert work == pytest.approx(area, rel=1e-8)


def test_a_diagram_of_four_strokes(machine):
    """Over two turns, with a jump at ignition; the other pistons and masses play no part."""
    angles, pressures = np.radians([0.0, 90.0, 270.0, 400.0, 600.0]), [1e5, (8e5, 40e5), 4e5, 1e5, 1e5]
    pressure = lj.Diagram(angles, pressures, cycle_turns=2)
    load = compressor(pressure=pressure, clearance=None)
    with pytest.raises(lj.StructureError, match="not a multiple of the period of the table"):
        with_loads(machine, load)
    scene = with_loads(machine, load, cycle_turns=2)
    pieces = [(0.0, 90.0, 1e5, 8e5), (90.0, 270.0, 40e5, 4e5), (270.0, 400.0, 4e5, 1e5), (400.0, 720.0, 1e5, 1e5)]
    work = 0.0
    for begin, end, p0, p1 in pieces:
        a, b = np.radians([begin, end])

        def power(phi, a=a, b=b, p0=p0, p1=p1):
            return -(p0 + (p1 - p0) * (phi - a) / (b - a) - 101325.0) * AREA * height(phi)[1]

        work += quad(power, a, b, epsrel=1e-12, limit=200)[0]
    assert works(scene, 96)["air"] == pytest.approx(work, rel=1e-10)


@pytest.mark.slow
def test_gas_acts_on_piston_and_head(machine):
    """The net force on the frame has no gas in it: it pushes the head as much as the piston."""
    cycle = lj.analyse(with_loads(machine, compressor()), angles=24, constant_speed=True)
    bare = lj.analyse(with_loads(machine), angles=24, constant_speed=True)
    one, two = cycle.forces_constant_speed.net_frame, bare.forces_constant_speed.net_frame
    size = np.max(np.abs(np.asarray(cycle.forces_constant_speed.frame.fy)))
    np.testing.assert_allclose(one.fy, two.fy, atol=1e-9 * size)
    assert np.max(np.abs(np.asarray(cycle.forces_constant_speed.frame.fy - two.fy))) > 0.1 * AREA * P2
    assert float(cycle.checks.virtual_power) < 1e-10 and float(cycle.checks.force_balance) < 1e-10


@pytest.mark.slow
def test_a_compressor_in_a_whole_analysis(machine):
    cycle = lj.analyse(with_loads(machine, compressor()), angles=24, nodes=320)
    assert float(cycle.work["air"]) == pytest.approx(-cycle_work(1.3), rel=1e-9)
    assert float(cycle.checks.energy_closure) < 1e-7 and int(cycle.result) == 0
    assert float(cycle.steady.mean_drive_torque) == pytest.approx(cycle_work(1.3) / TURN, rel=1e-9)


@pytest.mark.slow
def test_derivatives_with_respect_to_the_cylinder(machine):
    """The drive torque in closed form, with respect to bore, clearance, pressures and exponent; and δ by differences,
    also with respect to the lengths."""
    names = ["bore", "clearance", "suction", "discharge", "exponent"]
    scene = with_loads(machine, compressor())
    known = numbers(scene)
    values = [float(known[f"loads.air.{name}"].read(scene)) for name in names]

    def closed(bore, clearance, suction, discharge, n):
        filled = clearance + math.pi / 4 * bore**2 * STROKE - clearance * (discharge / suction) ** (1 / n)
        return n / (n - 1) * suction * filled * ((discharge / suction) ** ((n - 1) / n) - 1) / TURN

    def torque(*values):
        made = changed(scene, dict(zip((f"loads.air.{name}" for name in names), values, strict=True)))
        return steady_motion(made, 320).mean_drive_torque

    ours = jax.grad(torque, argnums=tuple(range(5)))(*map(jnp.asarray, values))
    truth = jax.grad(closed, argnums=tuple(range(5)))(*map(jnp.asarray, values))
    np.testing.assert_allclose(np.multiply(ours, values), np.multiply(truth, values), rtol=1e-7)

    def swing(given):
        load, crank, rod = given
        made = eqx.tree_at(lambda s: s.loads, scene, (load,))
        return steady_motion(changed(made, {"links.crank.length": crank, "links.rod2.length": rod}), 192).delta

    assert_gradients_agree(swing, (scene.loads[0], jnp.asarray(R), jnp.asarray(L)), np.random.default_rng(1),
                           difference=2e-6)  # fmt: skip


@pytest.mark.slow
def test_two_cylinders_deliver_twice(machine):
    """Names differ, ends are found for each; the second cylinder is below its crank pin."""
    two = dataclasses.replace(compressor(), name="other", link="piston5", point="E")
    found = works(with_loads(machine, compressor(), two), 320)
    assert [found["air"], found["other"]] == pytest.approx([-cycle_work(1.3)] * 2, rel=1e-8)


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "head": ({"head": "up"}, "head"),
    "bore": ({"bore": 0.0}, "bore of load 'air' is 0.0; write a number above zero"),
    "no clearance": ({"clearance": None}, "write the least volume"),
    "clearance": ({"clearance": -1e-6}, "write a number above zero"),
    "ambient": ({"ambient": -1.0}, "absolute pressure"),
    "order": ({"pressure": (4e5, 1e5, 1.3)}, "the lower one as suction"),
    "vacuum": ({"pressure": (0.0, 1e5, 1.3)}, "write a number above zero"),
    "exponent": ({"pressure": (1e5, 4e5, 0.0)}, "write a number above zero"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_gas_loads_are_refused(name):
    fields, remedy = BAD[name]
    if isinstance(fields.get("pressure"), tuple):
        fields = {"pressure": lj.Polytropic(*fields["pressure"])}
    with pytest.raises((ValueError, TypeError), match=remedy):
        compressor(**fields)


def test_bad_diagrams_are_refused():
    def refused(match: str, *given: Any, clearance: float | None = CLEARANCE, **fields: Any):
        with pytest.raises(ValueError, match=match):
            compressor(pressure=lj.Diagram(*given, **fields), clearance=clearance)

    refused("has no effect", [0.0, 1.0], [1e5, 2e5])
    refused("absolute pressures", [0.0, 1.0], [1e5, -2e5], clearance=None)
    refused("delete them", [0.0, 1.0], [1e5, 2e5], [1e5, 2e5], clearance=None)
    refused("steep part", [0.0, 1.0], [(1e5, 2e5), 2e5], by="volume")
    refused("increase cycle_turns", [0.0, 7.0], [1e5, 2e5], clearance=None)


def test_gas_needs_one_guide_on_the_frame(machine):
    with pytest.raises(lj.StructureError, match="name a point of one slider"):
        with_loads(machine, dataclasses.replace(compressor(), link="crank", point="B"))
