"""Wrong use of `optimise`: one line that names the element, what is wrong, and the remedy."""

from __future__ import annotations

import inspect
import tomllib
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import DesignError, at_least, at_most
from linkjax.design import Term, as_rows, changed
from linkjax.design._texts import settled_free, settled_limit
from tests.design.test_optimise import rotor

FREE = {"speed": (1.0, 2.0)}
PRESS = lj.load("hay-press")


def refused(scene: lj.Scene, *arguments, **others) -> str:
    """The message of a problem that is refused."""
    with pytest.raises(DesignError) as caught:
        lj.optimise(scene, *arguments, **others)
    said = str(caught.value)
    assert "\n" not in said and len(said) < 500
    return said


def both(scene):
    return jnp.stack([scene.speed, 2 * scene.speed])


def one(scene):
    return scene.speed[None]


@pytest.mark.parametrize(("function", "shape"), [(both, "(2,)"), (one, "(1,)")])
def test_a_vector_is_refused(function, shape):
    """As objective and as constraint of either sense, by name and shape."""
    expected = (
        f"{function.__name__}: returns an array of shape {shape}, not one number; return one number, e.g. jnp.max"
    )
    assert refused(rotor(), FREE, function).startswith(expected)
    assert refused(rotor(), FREE, maximise=function).startswith(expected)
    for sense in (at_most, at_least):
        assert refused(rotor(), FREE, "speed", limits=[sense(function, 3.0)]).startswith(expected)


def test_rows_are_asked_for_by_name():
    """Largest or smallest entry of an array, or length of its rows; anything else is refused."""
    small = lj.optimise(rotor(), {"speed": (1.0, 1.5)}, as_rows(both))
    assert small.objective == pytest.approx(2.0)
    large = lj.optimise(rotor(), {"speed": (1.0, 1.5)}, maximise=as_rows(both, smallest=True))
    assert large.objective == pytest.approx(1.5)
    expected = "lambda: returns an array of shape (), not of shape (rows,) or (rows, parts)"
    assert refused(rotor(), FREE, as_rows(lambda scene: scene.speed)).startswith(expected)
    assert "AttributeError" in refused(rotor(), FREE, as_rows(misspelt))


def branching(scene):
    return scene.speed if scene.speed > 1 else 0.0


def misspelt(scene):
    return scene.mechansm.flywheel.inertia


def with_numpy(scene):
    return np.sin(float(scene.speed))


def without_argument():
    return 1.0


def on_parts(parts):
    return parts.scen.speed


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (branching, "a Scene with traced numbers: TracerBoolConversionError: Attempted boolean conversion"),
        (misspelt, "a Scene with traced numbers: AttributeError: 'Scene' object has no attribute 'mechansm'"),
        (with_numpy, "a Scene with traced numbers: ConcretizationTypeError: "),
        (without_argument, "a Scene with traced numbers: TypeError: without_argument() takes 0 positional arguments"),
        (
            Term("on_parts", "1", on_parts),
            "Parts with traced numbers: AttributeError: 'OwnParts' object has no attribute",
        ),
    ],
)
def test_a_function_that_fails(function, says):
    """One line with the name of the function, its argument and the original error, which is the cause."""
    name = function.name if isinstance(function, Term) else function.__name__
    with pytest.raises(DesignError) as caught:
        lj.optimise(rotor(), FREE, function)
    said = str(caught.value)
    assert said.startswith(f"{name}: this function failed when called with {says}")
    assert "use jax.numpy instead of numpy or math" in said and "\n" not in said and len(said) < 500
    assert caught.value.__cause__ is not None


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (lambda scene: None, "lambda: returns None, which is not a number; return one number"),
        (lambda scene: {"x": scene.speed}, "returns a dict, which is not a number"),
        (lambda scene: scene.speed > 1, "returns a value of type bool, not a real number"),
    ],
)
def test_no_number(function, says):
    assert says in refused(rotor(), FREE, function)


def test_an_integer_is_a_number():
    assert lj.optimise(rotor(), FREE, cast(Any, lambda scene: 2)).objective == 2.0


def test_wrong_types_are_named():
    """A string in place of a list, and names in place of ranges or measures."""
    assert refused(PRESS, FREE, "delta", limits="delta <= 0.1") == (
        "limits: is a string; write a list, e.g. ['delta <= 0.1']"
    )
    for names in (["flywheel.inertia"], "flywheel.inertia"):
        with pytest.raises(DesignError, match=r"^flywheel.inertia: has no range; write a mapping from names to ranges"):
            settled_free(PRESS, names)
    with pytest.raises(TypeError, match=r"evaluate: 3 is not a measure; write measures or their names"):
        inspect.unwrap(lj.measures.evaluate)(PRESS, [3])  # without the type checks of the tests
    said = refused(PRESS, {"links.crank.counterweight.mass": "0 to 3 kg"}, "delta")
    assert "did you mean 'links.crank.counterweights.NAME.mass'?" in said


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("shaking_forces", ["'peak_shaking_force'", "'rms_shaking_force'"]),
        ("peak_reactions", ["'peak_reaction'", "'max_reaction'"]),
        ("links.rod.lenght", ["'links.rod.length'"]),
        ("regime_margin", ["it is called 'steady_state_margin' now"]),
        ("xyz", ["linkjax.measures.measure_names(scene) and linkjax.design.numbers(scene) give the names"]),
    ],
)
def test_unknown_names(name, near):
    """Several near names, and how a user-defined function is given."""
    said = refused(PRESS, FREE, "speed", limits=[f"{name} <= 3"])
    assert said.startswith(f"limits: {name}: is neither a measure nor a scene parameter; ")
    assert all(each in said for each in near), said
    assert said.endswith(
        "(in Python pass the function object, not its name: at_most(function, bound), minimise=function)"
    )


def crank(scene):
    return scene.mechanism.links["crank"].length


@pytest.mark.parametrize(
    ("limit", "unit", "bound"),
    [
        (at_least(crank, "150 mm"), "m", 0.15),
        (at_most(crank, "150 mm", name="reach"), "m", 0.15),
        (at_most(crank, "30 deg"), "rad", np.pi / 6),
        (at_most(crank, "2 kN m"), "N m", 2e3),
        (at_most(crank, "1500 mm/s"), "m/s", 1.5),
        (at_most(crank, "0.5"), "1", 0.5),
        (at_most(crank, 0.5), "1", 0.5),
        (at_most(crank, "initial"), "1", "initial"),
        (at_most(crank, "150 mm", unit="m"), "m", 0.15),
        (at_most(crank, "3 kg m", unit="kg m"), "kg m", 3.0),
    ],
)
def test_the_unit_of_a_bound(limit, unit, bound):
    found = settled_limit(PRESS, limit)
    assert (found.term.unit, found.bound) == (unit, bound if bound == "initial" else pytest.approx(bound, rel=1e-14))


@pytest.mark.parametrize(
    ("bound", "unit", "says"),
    [
        ("150 mm", "kg", "crank: its bound '150 mm' is in m, but unit is 'kg'; write the bound in this unit, or omit"),
        ("3 bananas", None, "crank: bound '3 bananas': unknown unit 'bananas'"),
        ("wide", None, "crank: bound 'wide': cannot be read as a number and a unit"),
        ("150 mm", "kg m", "crank: '150 mm' is not a number in kg m"),
        ("150", "m", "crank: '150': a number without a unit"),
    ],
)
def test_a_unit_that_contradicts_its_bound(bound, unit, says):
    with pytest.raises(DesignError) as caught:
        settled_limit(PRESS, at_least(crank, bound, unit=unit))
    assert str(caught.value).startswith(says)


def test_a_counterweight_that_is_missing():
    """The message shows how to add it, in Python and in a scene file; both ways work."""
    name = "links.crank.counterweights.W1.mass"
    said = refused(PRESS, {name: "0 to 60 kg"}, "delta")
    assert said.startswith(f"free: {name}: link 'crank' has no counterweight 'W1'; add it")
    assert 'Link(..., counterweights={"W1": Counterweight(0.0, Vec(-0.1, 0.0))})' in said
    assert "[links.crank.counterweights.W1]" in said
    key, _, value = said.split("--set '")[1].split("'")[0].partition("=")
    piece = tomllib.loads(f"piece = {value}")["piece"]
    assert (key, piece) == ("links.crank.counterweights.W1", {"mass": 0, "at": "-100 mm"})
    assert name in lj.design.numbers(lj.load("hay-press", {key: piece}))
    assert f"a table [{key}] in the scene file" in said
    other = "links.crank.counterweights.W.mass"
    has = rotor()
    assert "(it has 'W')" in refused(has, {other.replace("W.", "W2."): (0.0, 1.0)}, "speed")


def test_changed_with_units():
    scene = changed(PRESS, {"links.rod.length": "1050 mm", "speed": "600 rpm", "flywheel.inertia": 3})
    assert float(scene.mechanism.links["rod"].length) == 1.05
    assert float(scene.speed) == pytest.approx(20 * np.pi)
    assert float(scene.mechanism.flywheel.inertia) == 3.0
    with pytest.raises(DesignError, match=r"links\.rod\.length: '3 kg': a mass where a length is needed"):
        changed(PRESS, {"links.rod.length": "3 kg"})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"free": {"links.rod.length": "5 kg to 6 kg"}}, "free: links.rod.length: '5 kg': a mass where a length"),
        ({"limits": ["delta <= 3 kg"]}, "limits: delta: '3 kg': a mass where a plain number"),
        ({"minimise": "detla"}, "minimise: detla: is neither a measure nor a scene parameter; did you mean 'delta'"),
        ({"minimise": None, "maximise": "detla"}, "maximise: detla: is neither"),
        ({"cases": [lj.Case("idle", {"loads.hay.force": "3 kg"})]}, "cases: loads.hay.force: '3 kg': a mass"),
        ({"solver": "simplex"}, "solver: 'simplex' is not a solver; known here: cone"),
    ],
)
def test_an_error_names_its_argument(change, says):
    asked = {"free": FREE, "minimise": "delta", **change}
    assert refused(PRESS, **asked).startswith(says)


def test_a_measure_that_a_machine_does_not_have():
    """All groups of an elliptic trammel are of higher class."""
    said = refused(lj.load("elliptic-trammel"), {"speed": (1.0, 2.0)}, "min_transmission_angle")
    assert said.startswith("min_transmission_angle: does not exist for this machine")
