"""The section [optimise]: its problem, its changes, and its errors."""

from __future__ import annotations

import pytest

import linkjax as lj
from linkjax.scenes import SceneError, build, build_problem, load_document, overridden, override, read_document

HEAD = """
speed = "100 rpm"
fixed = { O = [0, 0] }
[links.crank]
length = "0.1 m"
mass = "2 kg"
[[groups]]
kind = "crank"
link = "crank"
pivot = "O"
end = "A"
"""
WHOLE = """
[optimise]
minimise = "peak_shaking_force_constant_speed"
limits = ["delta <= 0.15"]
starts = 3
seed = 7
solver = "slsqp"
trade_off = { limit = "delta", bounds = [0.1, "0.05"] }
[optimise.free]
"links.crank.counterweights.W.at.along" = "-100 to 0 mm"
"links.crank.length" = { range = "± 8 %", linked = ["links.crank.mass"] }
[[optimise.cases]]
name = "slow"
changes = { speed = "50 rpm" }
[optimise.changes]
"links.crank.counterweights.W" = { mass = "1 kg", at = 0 }
"""


def test_everything_is_read():
    document = read_document(HEAD + WHOLE)
    scene, asked = build_problem(document)
    assert float(scene.mechanism.links["crank"].counterweights["W"].mass) == 1.0
    assert not build(document).mechanism.links["crank"].counterweights  # an analysis ignores it
    assert asked["minimise"] == "peak_shaking_force_constant_speed"
    assert asked["maximise"] is None
    assert asked["free"]["links.crank.length"] == {"range": "± 8 %", "linked": ["links.crank.mass"]}
    assert (asked["limits"], asked["starts"], asked["seed"], asked["solver"]) == (["delta <= 0.15"], 3, 7, "slsqp")
    assert asked["cases"] == [lj.Case("slow", {"speed": "50 rpm"})]
    assert asked["trade_off"] == ("delta", [0.1, "0.05"])


def test_without_the_section_nothing_is_asked():
    _, asked = build_problem(read_document(HEAD))
    assert (asked["minimise"], asked["free"], asked["limits"], asked["starts"]) == (None, {}, [], 1)
    assert asked["cases"] == [lj.Case()]


def test_the_hay_press_asks_for_what_the_readme_says():
    scene, asked = lj.load_problem("hay-press")
    assert {name for name, link in scene.mechanism.links.items() if link.counterweights} == {"crank", "rocker"}
    scaled = {name for name, link in scene.mechanism.links.items() if link.mass_properties == "scaled"}
    assert scaled == {"rod", "link4", "rocker"}
    assert len(asked["free"]) == 10
    assert lj.load("hay-press").mechanism.links["crank"].counterweights == {}


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ("minimize = 'delta'", "optimise.minimize = .delta.: not a known key; did you mean 'minimise'"),
        ("minimise = 3", "optimise.minimise = 3: .* where a string or a table is needed"),
        ("free = { speed = 3 }", "optimise.free.speed = 3: an integer where a range is needed"),
        ("free = { speed = [1, 2, 3] }", "a list where a range is needed"),
        ("free = { speed = { rage = '± 8 %' } }", "unknown key 'rage'"),
        ("free = { speed = { range = '± 8 %', linked = 'x' } }", "`linked` is not a list of names"),
        ("limits = 'delta <= 0.15'", "optimise.limits"),
        ("limits = ['delta = 0.15']", r"optimise.limits\[0\] = .delta = 0.15.: .* write two constraints"),
        ("minimise = 'detla'", r"neither a measure nor a scene parameter; did you mean 'delta'\?$"),
        ("starts = 0", "optimise.starts = 0: not an integer from 1 to 10000"),
        ("starts = 1.5", "not an integer"),
        ("cases = [{ changes = {} }]", r"optimise.cases\[0\].name: missing"),
        ("cases = [{ name = 'a', changes = { speed = true } }]", "a truth value where a quantity is needed"),
        ("trade_off = { limit = 'delta' }", "optimise.trade_off.bounds: missing"),
        ("changes = { 'links.crank.lenth' = 1 }", "did you mean 'links.crank.length'"),
        ("changes = { 'links.crank.counterweights.W.mass' = 1 }", r"counterweights.W.at: missing"),
    ],
)
def test_what_is_wrong_is_named(section, says):
    with pytest.raises(SceneError, match=says):
        build_problem(read_document(f"{HEAD}\n[optimise]\n{section}\n".replace("'", '"'), "file.toml"))


def test_a_counterweight_may_be_added_by_hand():
    press = override(load_document("hay-press"), "links.crank.counterweights.W", '{ mass = "3 kg", at = "-0.1 m" }')
    assert float(build(press).mechanism.links["crank"].counterweights["W"].mass) == 3.0
    keys = {"links.crank.counterweights.K.mass": "2 kg", "links.crank.counterweights.K.at": "-0.1 m"}
    added = build(overridden(load_document("hay-press"), keys)).mechanism.links["crank"].counterweights["K"]
    assert (float(added.mass), float(added.at.x)) == (2.0, -0.1)
