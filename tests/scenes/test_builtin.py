"""The built-in scenes, the starter and the documentation: their content, and that every key is documented."""

import json
import math
import re
import tomllib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from linkjax._compile import compiled_soon
from linkjax._vec import Vec
from linkjax.groups import KINDS, RRP, RRR, Crank
from linkjax.kinematics import pose
from linkjax.loads import Force, OpposingForce, OpposingTorque, Torque, Window
from linkjax.machine import Scene
from linkjax.mechanism import Flywheel, Link, Mechanism
from linkjax.motion import steady_motion
from linkjax.scenes import json_schema, load, load_document, loads_text, scene_names, starter
from linkjax.scenes._groups import TABLES
from tests.helpers import PACKAGE, ROOT

NAMES = (
    "andrews-squeezer", "combine-cutter", "combine-shoe", "elliptic-trammel", "four-bar", "friction-slider-crank",
    "geared-press", "hay-press", "hay-press-slider", "kozhevnikov-press", "oscillating-cylinder",
    "press-with-friction", "press-with-motor", "pump-with-motor", "punch-press", "quick-return", "scissor-lift",
    "scotch-yoke", "slider-crank", "spring-door", "stephenson-3", "toggle-clamp", "toggle-press", "two-cylinder",
    "two-slider-press",
)  # fmt: skip
PAGES = [ROOT / "docs/scenes.md", *((ROOT / "docs/scenes").glob("*.md"))]
PAGE = "\n".join(path.read_text(encoding="utf-8") for path in PAGES)
BLOCKS = {
    f"{path.name}, block {i}": block
    for path in PAGES
    for i, block in enumerate(re.findall(r"^```toml\n(.*?)^```", path.read_text(encoding="utf-8"), re.M | re.S))
}


def press(slider: bool) -> Scene:
    """The hay press as given by reference data, with the load on the slider or on the rocker."""
    point = Vec(0.45 * math.cos(math.pi / 6), 0.45 * math.sin(math.pi / 6))
    links = {
        "crank": Link(length=0.3, mass=5.0, inertia=0.0 if slider else 0.65),
        "rod": Link(
            length=1.02, mass=15.0, inertia=0.65 if slider else 0.42, centre=Vec(0.5, 0.0), points={"E": point}
        ),
        "slider": Link(mass=40.0),
        "link4": Link(length=0.5, mass=3.2, inertia=0.05, centre=Vec(0.21, 0.0)),
        "rocker": Link(length=0.32, mass=10.0, inertia=0.12, centre=Vec(0.2, 0.0)),
    }
    groups = (Crank("crank", "A", "B"), RRP("rod", "slider", "B", "D", "A"), RRR(("link4", "rocker"), "E", "F", "G"))
    fixed = {"A": Vec(0.0, 0.0), "F": Vec(0.57, 0.58)}
    mechanism = Mechanism(fixed, links, groups, Flywheel(40.0 if slider else 0.0))
    window = Window(math.pi / 2, math.radians(335))
    if slider:
        loads = (OpposingForce("hay", "slider", "D", magnitude=30e3, window=window),)
        return Scene(mechanism, loads, Vec(0.0, -9.81), 73.27, title="Hay press, load on the slider")
    loads = (OpposingForce("hay", "rocker", "S5", magnitude=30e3, window=window, reacts_on="frame"),)
    return Scene(mechanism, loads, Vec(0.0, -9.8), 700 * math.pi / 30, 0.15, title="Hay press")


def test_names():
    assert scene_names() == NAMES
    assert {path.stem for path in (PACKAGE / "scenes/builtin").iterdir()} == set(NAMES)


@pytest.mark.parametrize(("name", "slider"), [("hay-press", False), ("hay-press-slider", True)])
def test_the_presses_are_the_reference_data(name, slider):
    read, made = load(name), press(slider)
    assert jax.tree.structure(read) == jax.tree.structure(made)
    for (path, one), two in zip(jax.tree_util.tree_leaves_with_path(read), jax.tree.leaves(made), strict=True):
        np.testing.assert_allclose(one, two, rtol=4e-16, atol=0, err_msg=jax.tree_util.keystr(path))


@pytest.mark.parametrize("name", NAMES)
def test_every_number_is_a_float64_array(name):
    for leaf in jax.tree.leaves(load(name)):
        assert isinstance(leaf, jax.Array) and leaf.dtype == jnp.float64 and leaf.shape == ()


def test_a_table_of_the_thesis():
    """The rebuilt scene at 45 degrees: D at 1.2098 m, S5 and G in the ratio 0.20 / 0.32 (thesis, table 1)."""
    at = pose(load("hay-press").mechanism, jnp.asarray(math.pi / 4)).points
    assert float(at["D"].r.x) == pytest.approx(1.2098, abs=5e-5)
    assert float(at["S5"].dr.x / at["G"].dr.x) == pytest.approx(0.625, rel=1e-12)


@pytest.mark.parametrize("name", ["four-bar", "quick-return", "scotch-yoke", "slider-crank"])
def test_invented_machines_are_plausible(name):
    """They run steadily at their speed, near the required fluctuation."""
    scene = load(name)
    regime = compiled_soon(steady_motion)(scene)
    assert float(regime.steady_state_margin) > 0.5
    assert scene.target_delta is not None and 0.5 < float(regime.delta / scene.target_delta) < 5
    assert float(regime.delta_error) < 1e-5


def test_the_known_answer_of_the_benchmark():
    """baselines/hay_press.py, an independent program in plain NumPy."""
    regime = compiled_soon(steady_motion)(load("hay-press-slider"))
    assert float(regime.delta) == pytest.approx(0.0903376817, abs=1e-9)
    assert float(regime.mean_drive_torque) == pytest.approx(3909.79995, abs=1e-4)


def test_the_mirrored_machine():
    """Clockwise, below the guide, with the left side of the guide reversed: the same crank pin, mirrored."""
    text = starter("mirrored").replace('offset = "0 mm"', 'offset = "7 mm"')
    there = loads_text(text)
    back = loads_text(text.replace('# rotation = "cw"', 'rotation = "cw"').replace('"7 mm"', '"-7 mm"'))
    one, two = (pose(scene.mechanism, jnp.asarray(1.0)).points for scene in (there, back))
    for point in ("B", "D", "S2"):
        np.testing.assert_allclose([one[point].r.x, one[point].r.y], [two[point].r.x, -two[point].r.y], atol=1e-15)
    assert float(one["D"].r.y) == pytest.approx(0.007, abs=1e-15)


def test_starter():
    scene = loads_text(starter('A "new" \\ press'))
    assert scene.title == 'A "new" \\ press'
    assert scene.mechanism.formula() == "I1(crank) → II2(rod, slider)"
    assert starter("\n\t").count("New machine") == 2


def test_starter_with_all_that_it_offers():
    text = re.sub(r"^# (?=\[\[|\w+(\.\w+)? = )", "", starter("x"), flags=re.M)
    text = text.replace("A = [0, 0]", 'A = [0, 0]\nF = ["100 mm", "120 mm"]')
    scene = loads_text(text + '[links.bar]\nlength = "100 mm"\n[links.rocker]\nlength = "90 mm"\n')
    assert scene.mechanism.formula() == "I1(crank) → II2(rod, slider) → II1(bar, rocker)"
    crank = scene.mechanism.groups[0]
    assert isinstance(crank, Crank) and crank.rotation == "cw" and scene.target_delta == 0.05


def test_every_kind_of_group_can_be_written():
    definitions = json_schema()["$defs"]
    found = [definitions[table.__name__]["properties"]["kind"]["const"] for table in TABLES.values()]
    assert found == list(TABLES) and set(TABLES) == set(KINDS)


@pytest.mark.parametrize("where", BLOCKS)
def test_documented_scenes_load(where):
    assert isinstance(loads_text(BLOCKS[where], where), Scene)


def test_documented_loads_are_what_they_say():
    scene = loads_text(BLOCKS["groups.md, block 0"])
    assert [type(item) for item in scene.loads] == [Force, Torque, OpposingTorque]
    coupler, rocker = scene.mechanism.links["coupler"], scene.mechanism.links["rocker"]
    k = 360 / 350  # mass ~ l, inertia ~ l^3, points ~ l, from the reference length
    assert float(coupler.actual().mass) == pytest.approx(3 * k, rel=1e-15)
    assert float(coupler.actual().inertia) == pytest.approx(0.04 * k**3, rel=1e-15)
    assert float(coupler.actual().points["U"].x) == pytest.approx(0.1 * k, rel=1e-15)
    assert float(rocker.actual().mass) == pytest.approx(900e-6 * 7850 * 0.26, rel=1e-15)
    assert scene.mean == "midrange" and coupler.centre_name == "C2"
    crank = scene.mechanism.groups[0]
    assert isinstance(crank, Crank) and crank.rotation == "cw" and float(crank.phase) == -math.pi / 6


def test_every_key_is_documented():
    schema = json_schema()
    tables = [schema, *schema["$defs"].values()]
    keys = {key for table in tables for key in table["properties"]}
    missing = [key for key in keys if not re.search(rf"`(\[+)?{key}\b", PAGE)]
    assert missing == []


def test_examples_in_the_tables_are_toml():
    examples = [row.split(" | ")[-1] for row in PAGE.splitlines() if row.startswith("| `") and row.count(" | ") > 2]
    found = [cell.strip("`| ") for cell in examples if "=" in cell]
    assert len(found) > 35
    for example in found:
        tomllib.loads(example)


def test_schema_is_json_and_has_valid_examples():
    schema = json_schema()
    assert set(json.loads(json.dumps(schema))["required"]) == {"speed", "fixed", "links"}
    assert schema["additionalProperties"] is False
    lengths = schema["$defs"]["Link"]["properties"]["length"]
    assert lengths["examples"] == ["300 mm"] and {"type": "number", "minimum": 0} in lengths["anyOf"]


def test_nothing_is_shared_between_two_loads():
    one, two = load_document("four-bar"), load_document("four-bar")
    one.table["links"].clear()
    assert two.table["links"]
    assert eqx.tree_equal(load("four-bar"), load("four-bar"))
