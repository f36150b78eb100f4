"""Scene files of rolling bodies: what is read, what is left out, what is said when something is wrong."""

from __future__ import annotations

import json
import math
import re
import tomllib

import jax
import jax.numpy as jnp
import jsonschema
import pytest

import linkjax as lj
from linkjax.rolling import check
from linkjax.scenes import (
    SceneError,
    build_rolling,
    loads_text,
    read_document,
    rolling_schema,
    rolling_starter,
    rolling_text,
)
from linkjax.scenes._rolling import RollingFile
from tests.helpers import PACKAGE, ROOT

GOLDEN = json.loads((ROOT / "tests/data/golden.json").read_text(encoding="utf-8"))
NAMES = ("rolling-eccentric", "rolling-prototype")
TEXT = (PACKAGE / "scenes/rolling/rolling-eccentric.toml").read_text(encoding="utf-8")
PAGE = (ROOT / "docs/rolling.md").read_text(encoding="utf-8")
RINGS = 'kind = "rolling"\nbodies = 8\nspeed = "300 rpm"\n'


def read(text: str) -> lj.RollingMachine:
    return build_rolling(read_document(text))


def test_the_built_in_ones_are_the_reference_data():
    assert lj.rolling_names() == NAMES
    for name, want, e in zip(NAMES, (GOLDEN["rolling.emk_e5"], GOLDEN["rolling.prototype"]), (5e-3, 0.0), strict=True):
        machine = lj.load_rolling(name)
        check(machine.design)
        assert float(machine.design.inner_radius) == want["Rv"] / 1e3 and float(machine.design.eccentricity) == e
        assert float(machine.design.outer_radius) == pytest.approx(want["Rn"] / 1e3, abs=1e-12)
        assert machine.design.bodies == want["z"] and machine.title
        assert float(machine.speed) == pytest.approx(300 * math.pi / 30) and (machine.held, machine.driven) == (
            "outer",
            "inner",
        )
        for leaf in jax.tree.leaves(machine):
            assert isinstance(leaf, jax.Array) and leaf.dtype == jnp.float64 and leaf.shape == ()


def test_what_is_left_out_closes_the_chain():
    inner, outer, e = '"40 mm"', '"95 mm"', '"5 mm"'
    for given in (f"inner_radius={inner}\neccentricity={e}", f"outer_radius={outer}\neccentricity={e}",
                  f"inner_radius={inner}\nouter_radius={outer}"):  # fmt: skip
        check(read(RINGS + given).design)
    free = read(RINGS + f"inner_radius={inner}\nouter_radius={outer}\neccentricity={e}").design
    assert (float(free.inner_radius), float(free.outer_radius), float(free.eccentricity)) == (0.04, 0.095, 0.005)
    with pytest.raises(lj.MachineError, match="does not close"):
        check(free)


def test_clockwise_and_changes():
    machine = lj.load_rolling(
        "rolling-eccentric", {"rotation": "cw", "held": "carrier", "start": "20 deg", "bodies": 9}
    )
    assert float(machine.speed) < 0 and machine.held == "carrier" and machine.design.bodies == 9
    assert float(machine.design.start) == math.radians(20)


CASES = {
    "unknown key": ("bodies = 8", "bodys = 8", 'bodys = 8: not a known key; did you mean \'bodies\'?'),
    "missing": ("bodies = 8", "", "bodies: missing; add bodies = 8"),
    "wrong dimension": ('"40 mm"', '"40 kg"', 'inner_radius = "40 kg": a mass where a length is needed'),
    "negative": ('"5 mm"', '"-5 mm"', 'eccentricity = "-5 mm": must not be negative; write the distance'),
    "radius of zero": ('"40 mm"', "0", "inner_radius = 0: must be greater than zero"),
    "angle": ('"0 deg"', "20", 'start = 20: an angle without a unit; write "20 deg"'),
    "number of bodies": ("bodies = 8", "bodies = 2.5", "bodies = 2.5: not a whole number from 3 to 1000"),
    "two turns": ("bodies = 8", "bodies = 8\nturns = 2",
                  "bodies = 8: 8 bodies in 2 turns already close with bodies 4, turns 1"),
    "member": ('"outer"', '"ring"', 'held = "ring": not one of the choices; write "inner" or "outer" or "carrier"'),
    "one member": ('"outer"', '"inner"', "driven = \"inner\": 'inner' is both held and driven; choose two"),
    "two missing": ('inner_radius = "40 mm"', "", "inner_radius: missing, and so is outer_radius: only one of"),
    "no inner ring": ('inner_radius = "40 mm"', 'outer_radius = "5 mm"', 'eccentricity = "5 mm": no inner ring closes'),
    "no eccentricity": ('eccentricity = "5 mm"', 'outer_radius = "80 mm"',
                        'outer_radius = "80 mm": no eccentricity closes the chain: 8 bodies leave no room for this '
                        "inner ring; take an outer radius of 89.5931524 mm at least, or more bodies"),
    "another kind": ('kind = "rolling"', 'kind = "gear"', 'kind = "gear": not a known kind of machine; write kind ='),
    "a linkage": ('kind = "rolling"', "", "kind: no rolling bodies; load a linkage with linkjax.load"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_messages(name):
    old, new, told = CASES[name]
    assert old in TEXT
    with pytest.raises(SceneError) as caught:
        read(TEXT.replace(old, new, 1))
    assert str(caught.value).startswith(f"<text>: {told}")


def test_a_linkage_is_not_taken_for_one_nor_the_other_way_round():
    for wrong in (
        lambda: lj.load("rolling-eccentric"),
        lambda: lj.load_problem("rolling-eccentric"),
        lambda: loads_text(TEXT),
    ):
        with pytest.raises(SceneError, match="rolling bodies, where a linkage is needed; read it with load_rolling"):
            wrong()
    with pytest.raises(SceneError, match="load a linkage with"):
        lj.load_rolling("hay-press")
    with pytest.raises(SceneError, match="did you mean 'rolling-eccentric'"):
        lj.load_rolling("roling-eccentric")
    with pytest.raises(SceneError, match="eccentricty is not a known key; did you mean 'eccentricity'"):
        lj.load_rolling("rolling-eccentric", {"eccentricty": "3 mm"})


@pytest.mark.parametrize("changes", [{}, {"rotation": "cw", "start": "20 deg", "title": ""}, {"bodies": 7, "turns": 2}])
def test_what_is_written_reads_back_to_the_last_bit(changes):
    machine = lj.load_rolling("rolling-eccentric", changes)
    text = rolling_text(machine, "found by\nNewton's method")
    assert text.startswith("# found by\n# Newton's method\n")
    again = read(text)
    assert jax.tree.structure(again) == jax.tree.structure(machine)
    assert list(map(float, jax.tree.leaves(again))) == list(map(float, jax.tree.leaves(machine)))
    many = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), machine)
    with pytest.raises(lj.StructureError, match="traced or batched"):
        rolling_text(many)


def test_the_starter():
    machine = read(rolling_starter('A "pump"'))
    check(machine.design)
    assert machine.title == 'A "pump"'


def test_the_schema_tells_good_scenes_from_bad_ones():
    validator = jsonschema.Draft202012Validator(rolling_schema())
    jsonschema.Draft202012Validator.check_schema(rolling_schema())
    documented = re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)
    good = [
        TEXT,
        rolling_starter("x"),
        *documented,
        (PACKAGE / "scenes/rolling/rolling-prototype.toml").read_text("utf-8"),
    ]
    assert documented
    for text in good:
        assert validator.is_valid(tomllib.loads(text))
        read(text)
    for name in ("unknown key", "missing", "angle", "number of bodies", "member", "another kind"):
        old, new, _ = CASES[name]
        assert not validator.is_valid(tomllib.loads(TEXT.replace(old, new, 1))), name


def test_every_key_is_documented():
    assert [key for key in RollingFile.model_fields if f"| `{key}` |" not in PAGE] == []
