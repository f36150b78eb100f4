"""Many designs simultaneously: the same as one by one, for any number."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj


def length(design):
    return jnp.sqrt(design["x"] ** 2 + jnp.sum(design["y"] ** 2)), design["x"] + 1.0


def designs(count):
    rng = np.random.default_rng(count)
    return {"x": jnp.asarray(rng.normal(size=count)), "y": jnp.asarray(rng.normal(size=(count, 3)))}


@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 61])
@pytest.mark.parametrize("block", [1, 4])
def test_the_same_as_vmap(count, block):
    some = designs(count)
    for got, expected in zip(lj.map_designs(length, block=block)(some), jax.vmap(length)(some), strict=True):
        assert got.shape == expected.shape
        np.testing.assert_allclose(got, expected, rtol=1e-15)


def test_every_device_works():
    assert jax.device_count() > 1
    got, _ = lj.map_designs(length)(designs(2 * jax.device_count()))
    assert len(got.sharding.device_set) == jax.device_count()


def test_bad_batches_are_refused():
    with pytest.raises(ValueError, match="same leading axis of designs, but they have: 2, 3"):
        lj.map_designs(length)({"x": jnp.ones(2), "y": jnp.ones((3, 3))})
    with pytest.raises(ValueError, match="they have: none"):
        lj.map_designs(length)({"x": jnp.ones(()), "y": jnp.ones(())})
    with pytest.raises(ValueError, match="block must be at least 1, but is 0"):
        lj.map_designs(length, block=0)


@pytest.mark.slow
def test_a_cycle_of_many_machines():
    scene = lj.load("slider-crank")
    speeds = jnp.asarray([8.0, 9.0, 10.0, 11.0, 12.0])

    def drive(speed):
        rate = jnp.asarray(speed)
        return lj.measures.mean_drive_torque(dataclasses.replace(scene, speed=rate), 32)

    got = lj.map_designs(drive, block=2)(speeds)
    np.testing.assert_allclose(
        got, float(jax.jit(drive)(speeds[0])), rtol=1e-12
    )  # the work does not depend on the speed
