"""Motion laws composed of moves: shapes against published coefficients, ends, continuity, breaks; scene files."""

from __future__ import annotations

import itertools
import json
import math
from typing import Any, get_args

import jax
import jax.numpy as jnp
import jsonschema
import numpy as np
import pytest

import linkjax as lj
from linkjax.analysis import document
from linkjax.design import changed, numbers
from linkjax.groups import Shape
from linkjax.measures import MEASURES, evaluate
from linkjax.scenes import SceneError, json_schema, loads_text, text_of
from linkjax.scenes._write import table_of
from tests.helpers import assert_gradients_agree

TURN = 2 * math.pi
PEAKS = {  # greatest speed and acceleration of a unit rise over a unit angle; Norton, Cam Design and Manufacturing
    "3-4-5": (1.875, 5.7735),
    "4-5-6-7": (2.1875, 7.5132),
    "cycloidal": (2.0, 6.2832),
    "modified_sine": (1.7596, 5.5280),
    "modified_trapezoid": (2.0, 4.8881),
    "trapezoidal": (1.5, 4.5),
}


def rise(shape: Any, ramp: float | None = None) -> lj.Moves:
    """A unit rise over half a radian and back."""
    return lj.Moves(0.0, [lj.Move(1.0, 0.5, shape, ramp), lj.Move(0.0, 0.5, shape, ramp)], 1.0)


@pytest.mark.parametrize("shape", PEAKS)
def test_peaks_are_those_of_the_handbook(shape):
    law, (speed, acceleration) = rise(shape), PEAKS[shape]
    x = jnp.linspace(0.0, 0.5, 40001)[:-1]
    got = jax.vmap(law.at)(x)
    assert float(jnp.max(jnp.abs(got.d))) == pytest.approx(speed / 0.5, abs=2e-4)
    assert float(jnp.max(jnp.abs(got.dd))) == pytest.approx(acceleration / 0.25, abs=4e-4)


@pytest.mark.parametrize("shape", PEAKS)
def test_ends_and_symmetry(shape):
    law = rise(shape)
    begin, middle, end = (law.at(jnp.asarray(x)) for x in (0.0, 0.25, 0.5))
    assert float(begin.value) == 0.0 and float(begin.d) == 0.0
    assert float(middle.value) == pytest.approx(0.5, abs=1e-15)
    assert float(end.value) == pytest.approx(1.0, abs=1e-15) and float(end.d) == pytest.approx(0.0, abs=1e-14)
    x = jnp.linspace(0.01, 0.24, 50)
    np.testing.assert_allclose(jax.vmap(law.at)(0.5 - x).value, 1 - jax.vmap(law.at)(x).value, rtol=0, atol=1e-14)


FULL = lj.Moves(
    0.2,
    [
        lj.Move(1.0, 1.1, "3-4-5"),
        lj.Move(None, 0.4, "dwell"),
        lj.Move(0.7, 0.5, "modified_trapezoid"),
        lj.Move(-0.3, 0.8, "4-5-6-7"),
        lj.Move(-0.9, 0.6, "constant_speed"),
        lj.Move(-0.5, 0.7, "3-4-5"),
        lj.Move(0.0, 0.9, "trapezoidal", 0.25),
        lj.Move(0.1, 0.3, "modified_sine"),
        lj.Move(None, 0.6, "cycloidal"),
        lj.Move(shape="dwell"),
    ],
)


@pytest.mark.slow
@pytest.mark.parametrize("law", [FULL, *(rise(shape) for shape in PEAKS), rise("trapezoidal", 0.5)])
def test_the_speed_is_continuous_and_rates_are_derivatives(law):
    """Between breaks rates are derivatives; at breaks value and speed agree on both sides, and so does the integral of
    the acceleration with the speed."""
    breaks = np.sort([float(b) for b in law.breaks()])
    assert breaks[0] == 0 and breaks[-1] < law.period()
    tiny = 1e-9
    for b in breaks:
        one, two = (law.at(jnp.asarray(b + move)) for move in (-tiny, tiny))
        assert float(one.value) == pytest.approx(float(two.value), abs=1e-7)
        assert float(one.d) == pytest.approx(float(two.d), abs=1e-6)
    ends = np.append(breaks, law.period())
    nodes, weights = np.polynomial.legendre.leggauss(20)
    for a, b in itertools.pairwise(ends):
        if b - a < 1e-9:
            continue
        x = jnp.asarray((a + b) / 2 + (b - a) / 2 * nodes)
        got = jax.vmap(law.at)(x)
        first = jax.vmap(jax.grad(lambda x: law.at(x).value))(x)
        second = jax.vmap(jax.grad(lambda x: law.at(x).d))(x)
        np.testing.assert_allclose(got.d, first, rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(got.dd, second, rtol=1e-10, atol=1e-9)
        gain = float(law.at(jnp.asarray(b - tiny)).d - law.at(jnp.asarray(a + tiny)).d)
        assert gain == pytest.approx((b - a) / 2 * float(weights @ np.asarray(got.dd)), abs=3e-6)
        way = float(law.at(jnp.asarray(b - tiny)).value - law.at(jnp.asarray(a + tiny)).value)
        assert way == pytest.approx((b - a) / 2 * float(weights @ np.asarray(got.d)), abs=3e-7)


def test_values_and_angles():
    """At the ends of the moves the law has their values, constant speed is constant, and a dwell rests."""

    def at(x: float) -> Any:
        return FULL.at(jnp.asarray(x))

    for angle, value in ((0.0, 0.2), (1.1, 1.0), (1.5, 1.0), (2.0, 0.7), (2.8, -0.3), (3.4, -0.9), (5.0, 0.0)):
        assert float(at(angle).value) == pytest.approx(value, abs=1e-14)
    for angle in (2.8 + 1e-9, 3.0, 3.4 - 1e-9):
        assert float(at(angle).d) == pytest.approx(-1.0, abs=1e-6)
    assert float(at(1.3).d) == float(at(6.1).d) == 0.0 and float(at(6.1).value) == 0.2
    np.testing.assert_allclose(at(0.4 - TURN), at(0.4), rtol=1e-12, atol=1e-12)
    assert FULL.begins() == 0.2 and FULL.period() == TURN


def test_gradients(rng):
    x = jnp.asarray(np.linspace(0.13, 6.1, 17))
    weights = jnp.asarray(rng.normal(size=(3, 17)))

    def value(law: lj.Moves) -> jax.Array:
        return jnp.sum(weights * jnp.stack(jax.vmap(law.at)(x)))

    assert_gradients_agree(value, FULL, rng)
    moved = jax.jacfwd(lambda law: jnp.stack(law.breaks()))(FULL)
    assert float(moved.moves[0].over[1]) == 1.0 and float(moved.moves[2].over[1]) == 0.0


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: lj.Move(1.0, 0.0), r"crank angle of a move is 0\.0 rad"),
        (lambda: lj.Move(1.0, 1.0, "trapezoidal", 0.6), r"ramp of a move is 0\.6"),
        (lambda: lj.Move(1.0, 1.0, "3-4-5", 0.3), 'ramp of a move of shape "3-4-5" has no effect'),
        (lambda: lj.Moves(0.0, []), "nothing moves"),
        (lambda: lj.Moves(0.0, [lj.Move(0.0, 1.0), lj.Move()]), "all values of a law are the same"),
        (lambda: lj.Moves(0.0, [lj.Move(1.0), lj.Move()]), "move 1 of a law has no crank angle"),
        (lambda: lj.Moves(0.0, [lj.Move(None, 1.0), lj.Move()]), "move 1 of a law has no value"),
        (lambda: lj.Moves(0.0, [lj.Move(1.0, 1.0), lj.Move(0.5)]), r"move 2 of a law ends at 0\.5, not at the start"),
        (lambda: lj.Moves(0.0, [lj.Move(1.0, 7.0), lj.Move()]), "has the rest of its cycle"),
        (lambda: lj.Moves(0.0, [lj.Move(1.0, 1.0), lj.Move(0.0, 1.0)]), r"has the rest of its cycle, 302\.704"),
        (lambda: lj.Moves(0.0, [lj.Move(1.0, 1.0), lj.Move(0.5, 1.0, "dwell"), lj.Move()]), "is a dwell to 0.5"),
        (lambda: lj.Moves(0.0, [lj.Move(1.0, 1.0, "constant_speed"), lj.Move(None, None, "cycloidal")]), "speed jumps"),
        (lambda: lj.Moves(0.0, [lj.Move(1.0, 1.0, "constant_speed"), lj.Move(2.0, 1.0, "constant_speed"), lj.Move()]),
         "speed jumps"),
    ],
)  # fmt: skip
def test_what_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()


SLIDE = """
speed = "30 rpm"
[fixed]
A = [0, 0]
[links.ram]
mass = "2 kg"
[[groups]]
kind = "linear_driver"
link = "ram"
end = "B"
guide = { through = "A" }
[groups.law]
start = "10 mm"
moves = [
    { to = "90 mm", over = "100 deg", shape = "modified_sine" },
    { over = "80 deg", shape = "dwell" },
    { to = "40 mm", over = "60 deg", shape = "trapezoidal", ramp = 0.25 },
    { to = "10 mm", over = "120 deg" },
]
"""


def test_a_scene_with_moves():
    scene = loads_text(SLIDE)
    law = scene.mechanism.driver.follows()
    assert isinstance(law, lj.Moves) and [move.shape for move in law.moves] == ["modified_sine", "dwell", "trapezoidal",
                                                                               "3-4-5"]  # fmt: skip
    again = loads_text(text_of(scene))
    assert jax.tree.structure(again) == jax.tree.structure(scene)
    assert all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(scene), strict=True))
    assert not list(jsonschema.Draft202012Validator(json.loads(json.dumps(json_schema()))).iter_errors(table_of(scene)))
    assert "ram moves between 10 mm and 90 mm (law of 4 moves)" in str(scene)
    names = [name.removeprefix("groups.ram.law.") for name in numbers(scene) if ".law." in name]
    assert names == ["start", "moves[0].to", "moves[0].over", "moves[1].over", "moves[2].to", "moves[2].over",
                     "moves[2].ramp"]  # fmt: skip
    new = changed(scene, {"groups.ram.law.moves[0].to": "80 mm", "groups.ram.law.moves[0].over": "90 deg"})
    assert float(lj.pose(new.mechanism, jnp.asarray(math.pi / 2)).points["B"].r.x) == pytest.approx(0.08)


@pytest.mark.slow
def test_the_drive_of_a_ram_with_moves():
    """The force of the drive is mass times acceleration, its greatest value that of the law; power returns."""
    scene = loads_text(SLIDE)
    cycle = lj.analyse(scene, angles=90)
    law = scene.mechanism.driver.follows()
    assert law is not None
    got = jax.vmap(law.at)(jnp.asarray(cycle.angles))
    (drive,) = cycle.forces.reactions["ram.drive"].values()
    np.testing.assert_allclose(drive.fx, 2 * got.dd * math.pi**2, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(cycle.forces.drive_torque, drive.fx * got.d, rtol=1e-9, atol=1e-10)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-9


@pytest.mark.slow
def test_peaks_at_jumps_of_the_acceleration():
    """The drive torque is greatest at the end of a ramp, where it jumps to zero: the peak is the limit from below."""
    law = """start = "0 mm"
moves = [
    { to = "90 mm", over = "120 deg", shape = "trapezoidal", ramp = 0.4 },
    { over = "240 deg", shape = "4-5-6-7" },
]
"""
    scene = loads_text(SLIDE[: SLIDE.index("start =")] + law)
    cycle = lj.analyse(scene, angles=20)
    speed = 0.09 / (TURN / 3) / 0.6  # in the middle of the rise, with respect to the crank angle
    force = 2 * math.pi**2 * speed / (0.4 * TURN / 3)
    for key, sign in (("max_drive_torque", 1), ("min_drive_torque", -1)):
        peak = document(cycle)["peaks"][key]
        assert peak["value"] == pytest.approx(sign * force * speed, rel=1e-9) and peak["error"] < 1e-9
        assert peak["angle"] == pytest.approx((0.4 if sign > 0 else 0.6) * TURN / 3, abs=1e-9)

    def torque(over):
        return evaluate(
            changed(scene, {"groups.ram.law.moves[0].over": over}), [MEASURES["max_drive_torque_constant_speed"]]
        )

    over = jnp.asarray(TURN / 3)
    (value,), (slope,) = (jax.tree.leaves(each) for each in (torque(over), jax.jit(jax.jacfwd(torque))(over)))
    assert float(value) == pytest.approx(force * speed, rel=1e-9)
    assert float(slope) == pytest.approx(-3 * force * speed / float(over), rel=1e-6)  # in proportion to over^-3


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        ('start = "10 mm"\n', "", "groups[0].law", "or start and moves"),
        ("ramp = 0.25", "ramp = 0.75", "groups[0].law.moves", "ramp of a move is 0.75"),
        ('shape = "dwell"', 'shape = "rest"', "groups[0].law.moves[1].shape", 'write "3-4-5" or "4-5-6-7"'),
        ('{ to = "40 mm", over', "{ over", "groups[0].law.moves", "move 3 of a law has no value"),
        ('{ to = "10 mm", over = "120 deg" }', '{ over = "110 deg" }', "groups[0].law.moves", "120 deg; omit its"),
        ('to = "90 mm"', 'to = "90 deg"', "groups[0].law.moves[0].to", "an angle where a length"),
        ('over = "80 deg"', 'over = "-80 deg"', "groups[0].law.moves[1].over", "must not be negative"),
    ],
)
def test_messages(old, new, key, says):
    assert SLIDE.count(old) == 1
    with pytest.raises(SceneError) as caught:
        loads_text(SLIDE.replace(old, new), "slide.toml")
    assert caught.value.key == key and says in str(caught.value), str(caught.value)


def test_every_shape_is_tested():
    assert set(PEAKS) | {"constant_speed", "dwell"} == set(get_args(Shape))
