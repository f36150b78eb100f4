"""Mass and force reduced to a translating link, and the ratio of inertia to working forces, against closed forms."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import pytest

import linkjax as lj
from linkjax import measures
from linkjax._compile import compiled_soon
from linkjax.library import scotch_yoke

RADIUS, MASS, INERTIA, FORCE, SPEED = 0.05, 3.0, 0.02, 40.0, 12.0


def yoke(inertia: float = INERTIA, force: float = FORCE, mass: float = MASS) -> lj.Scene:
    """A heavy yoke with a constant force along its guide, and a crank that has an inertia."""
    links = {"yoke": lj.Link(mass=mass), "crank": lj.Link(inertia=inertia)}
    load = lj.Force("push", "yoke", "E", force=lj.Vec(force, 0.0))
    return lj.Scene(scotch_yoke(RADIUS, links=links), (load,), speed=SPEED)


@pytest.mark.parametrize("degrees", [35.0, 140.0, 250.0])
def test_reduced_to_a_yoke(degrees):
    """x = r cos φ, ds/dφ = r |sin φ|: the crank adds J / (r sin φ)² to the mass, and the force keeps its size."""
    phi = math.radians(degrees)
    found = lj.reduced_mass(yoke(), jnp.asarray(phi), "E")
    sine, way = abs(math.sin(phi)), math.copysign(1, math.sin(phi))
    assert float(found.mass) == pytest.approx(MASS + INERTIA / (RADIUS * sine) ** 2, rel=1e-12)
    slope = -2 * INERTIA * math.cos(phi) / (RADIUS**2 * sine**3 * way) / (RADIUS * sine)
    assert float(found.slope) == pytest.approx(slope, rel=1e-12)
    assert float(found.force) == pytest.approx(-way * FORCE, rel=1e-12)


def test_the_equation_of_motion_of_the_point():
    """m dv/dt + ½ v² dm/ds = F with any speed and acceleration of the crank, and the drive torque that they need."""
    phi, rate, scene = 0.7, 5.0, yoke()
    here, model = lj.reduced_mass(scene, jnp.asarray(phi), "E"), lj.reduced_model(scene, jnp.asarray(phi))
    way, bend = RADIUS * math.sin(phi), RADIUS * math.cos(phi)
    v, a = way * SPEED, way * rate + bend * SPEED**2
    drive = model.inertia * rate + 0.5 * model.slope * SPEED**2 - model.torque
    assert float(here.mass * a + 0.5 * v**2 * here.slope) == pytest.approx(float(here.force + drive / way), rel=1e-12)


def test_where_the_point_stops_the_mass_is_unbounded():
    with pytest.raises(ValueError, match=r"point 'E' stops at 180 degrees of crank angle.*choose another"):
        lj.reduced_mass(yoke(), jnp.asarray(math.pi), "E")
    found = jax.jit(lambda phi: lj.reduced_mass(yoke(), phi, "E"))(jnp.asarray(math.pi))
    assert all(bool(jnp.isinf(part)) for part in found)
    with pytest.raises(lj.StructureError, match="A: is not a point of a moving link"):
        lj.reduced_mass(yoke(), jnp.asarray(1.0), "A")


def test_derivative_of_a_reduced_mass():
    slope = compiled_soon(jax.grad(lambda mass: lj.reduced_mass(yoke(mass=mass), jnp.asarray(1.0), "E").mass))
    assert float(slope(MASS)) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.slow
def test_ratio_of_inertia_to_working_forces():
    """Of a yoke m r ω² / F, and infinite where statics gives no force."""
    name = "inertia_force_ratio_constant_speed"
    found = float(measures.evaluate(yoke(inertia=0.0), [name])[name])
    assert found == pytest.approx(MASS * RADIUS * SPEED**2 / FORCE, rel=1e-9)
    assert math.isinf(float(measures.evaluate(yoke(inertia=0.0, force=0.0), [name])[name]))
