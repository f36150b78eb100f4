"""Tables and gas loads in scene files: what is read, written, shown, and what bad input gets."""

from __future__ import annotations

import math
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax.design import changed, numbers
from linkjax.scenes import SceneError, load, loads_text, text_of
from tests.helpers import PACKAGE

HEAD = (PACKAGE / "scenes/builtin/two-cylinder.toml").read_text(encoding="utf-8").split("[[loads]]")[0]
ROW = '[[loads]]\nkind = "table"\nname = "row"\nlink = "crank"\nvalues = ["0 N m", "2 N m", "3 N m", "1 N m"]\n'
JUMP = """[[loads]]
kind = "table"
name = "jump"
link = "piston3"
point = "D"
angles = ["0 deg", "90 deg", "90 deg", "360 deg"]
values = ["0 N", "2 kN", "3 N", "1 N"]
method = "cubic"
direction = "y"
"""
STROKE = """[[loads]]
kind = "table"
name = "cut"
link = "piston3"
point = "D"
over = { point = "D" }
positions = ["190 mm", "28 cm"]
going = ["0 N", "2 N"]
coming = ["0 N", "-2 N"]
"""
ANGLE = """[[loads]]
kind = "table"
name = "swing"
link = "rod2"
over = { link = "rod2" }
angles = ["80 deg", "100 deg"]
values = ["0 N m", "2 N m"]
"""
AIR = """[[loads]]
kind = "gas"
name = "air"
link = "piston3"
point = "D"
bore = "80 mm"
head = "+"
clearance = "20 cm^3"
suction = "1 bar"
discharge = "6 bar"
exponent = 1.3
"""
VOLUME = """[[loads]]
kind = "gas"
name = "steam"
link = "piston5"
point = "E"
bore = "80 mm"
head = "+"
clearance = "20 cm^3"
volumes = ["20 cm^3", "100 cm^3", "600 cm^3"]
going = ["30 bar", "10 bar", "4 bar"]
coming = ["20 bar", "5 bar", "1 bar"]
reacts_on = "outside"
"""
CRANK = """[[loads]]
kind = "gas"
name = "engine"
link = "piston5"
point = "E"
bore = "80 mm"
head = "+"
ambient = "1 bar"
angles = ["0 deg", "100 deg", "200 deg"]
pressures = ["20 bar", "5 bar", "1 bar"]
"""
EVERY = {"row": ROW, "jump": JUMP, "cut": STROKE, "swing": ANGLE, "air": AIR, "steam": VOLUME, "engine": CRANK}


def one(text: str) -> lj.Scene:
    return loads_text(HEAD + text, "bad.toml")


def floats(values) -> list:
    return [tuple(map(float, value)) if isinstance(value, tuple) else float(value) for value in values]


def table(text: str) -> lj.Table:
    found = one(text).loads[0]
    assert isinstance(found, lj.Table)
    return found


def gas(text: str) -> lj.Gas:
    found = one(text).loads[0]
    assert isinstance(found, lj.Gas)
    return found


def test_tables_are_read_in_si_units():
    row, jump, cut, swing = map(table, (ROW, JUMP, STROKE, ANGLE))
    assert floats(row.at) == pytest.approx(list(np.radians([0, 90, 180, 270])), rel=1e-15)
    assert floats(row.values) == [0.0, 2.0, 3.0, 1.0] and row.point == "" and row.method == "linear"
    assert floats(jump.values) == [(1.0, 0.0), (2000.0, 3.0)] and jump.method == "cubic"
    assert jump.direction is not None and float(jump.direction) == pytest.approx(math.pi / 2, rel=1e-15)
    assert cut.over is not None and cut.over.point == "D" and floats(cut.at) == [0.19, 0.28]
    assert floats(cut.values) == [0.0, 2.0] and floats(cut.coming) == [0.0, -2.0] and cut.direction is None
    assert swing.over is not None and swing.over.link == "rod2"
    along = table(STROKE.replace('{ point = "D" }', '{ point = "D", direction = "30 deg" }')).over
    assert along is not None and along.direction is not None and float(along.direction) == pytest.approx(math.pi / 6)


def test_gas_loads_are_read_in_si_units():
    air, steam, engine = map(gas, (AIR, VOLUME, CRANK))
    assert float(air.bore) == 0.08 and air.clearance is not None and float(air.clearance) == pytest.approx(2e-5)
    assert isinstance(air.pressure, lj.Polytropic) and float(air.ambient) == 101325.0
    assert [float(air.pressure.suction), float(air.pressure.discharge)] == [1e5, 6e5]
    assert isinstance(steam.pressure, lj.Diagram) and steam.pressure.by_volume and steam.reacts_on is None
    assert floats(steam.pressure.coming) == [20e5, 5e5, 1e5] and air.reacts_on == "frame"
    assert isinstance(engine.pressure, lj.Diagram) and not engine.pressure.by_volume and engine.clearance is None


def test_a_table_takes_as_many_turns_as_the_scene():
    four = loads_text("cycle_turns = 2\n" + HEAD + ROW + CRANK)
    row, engine = four.loads
    assert isinstance(row, lj.Table) and row.cycle_turns == 2
    assert floats(row.at) == pytest.approx(list(np.radians([0, 180, 360, 540])))
    assert isinstance(engine, lj.Gas) and isinstance(engine.pressure, lj.Diagram) and engine.pressure.cycle_turns == 2
    each = loads_text("cycle_turns = 2\n" + HEAD + ROW + "cycle_turns = 1\n").loads[0]
    assert isinstance(each, lj.Table) and each.cycle_turns == 1


@pytest.mark.parametrize("name", EVERY)
def test_what_is_written_is_read_again(name):
    first = one(EVERY[name])
    second = loads_text(text_of(first))
    (a, one_), (b, two) = jax.tree.flatten(first), jax.tree.flatten(second)
    assert one_ == two and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def test_every_number_is_a_parameter():
    scene = one("".join(EVERY.values()))
    known = {name.removeprefix("loads."): number for name, number in numbers(scene).items() if "loads" in name}
    assert {"row.values[3]", "row.angles[0]", "jump.values[0][1]", "jump.angles[1]", "jump.direction",
            "cut.positions[1]", "cut.going[0]", "cut.coming[1]", "swing.angles[1]", "air.bore", "air.clearance",
            "air.ambient", "air.suction", "air.discharge", "air.exponent", "steam.volumes[2]", "steam.coming[0]",
            "engine.angles[2]", "engine.pressures[0]"} <= set(known)  # fmt: skip
    assert not {"jump.values[0]", "engine.clearance"} & set(known)
    units = {"row.values[3]": "N m", "jump.values[0][1]": "N", "cut.positions[1]": "m", "air.suction": "Pa",
             "air.clearance": "m^3", "steam.volumes[2]": "m^3", "swing.angles[1]": "rad"}  # fmt: skip
    assert {name: known[name].unit for name in units} == units
    leaves = sum(leaf.size for leaf in jax.tree.leaves(scene.loads))
    assert len(known) == leaves
    new = changed(scene, {"loads.air.suction": "2 bar", "loads.row.values[3]": "7 N m", "loads.jump.values[1][0]": 5.0})
    after = numbers(new)
    read = [float(after[f"loads.{name}"].read(new)) for name in ("air.suction", "row.values[3]", "jump.values[1][0]")]
    assert read == [2e5, 7.0, 5.0]
    assert all(number.least <= float(number.read(scene)) for number in known.values())


def test_keys_can_be_set(tmp_path):
    file = tmp_path / "row.toml"
    file.write_text(HEAD + ROW, encoding="utf-8")
    found = load(file, {"loads.row.values[1]": "9 N m", "loads.row.method": "cubic"}).loads[0]
    assert isinstance(found, lj.Table) and floats(found.values)[1] == 9.0 and found.method == "cubic"


def test_they_are_shown_in_words():
    text = str(one("".join(EVERY.values())))
    for part in ("table over the crank angle, 0 N·m to 3 N·m", "table over the position of D, −2 N to 2 N",
                 "table over the angle of rod2", "compressor, bore 80 mm, 100 kPa to 600 kPa, n = 1.3",
                 "gas by an indicator diagram over the volume, bore 80 mm, 100 kPa to 3 MPa"):  # fmt: skip
        assert part in text, part


@pytest.mark.slow
def test_an_analysis_of_all_of_them():
    cycle = lj.analyse(one("".join(EVERY.values())), angles=24)
    assert float(cycle.checks.virtual_power) < 1e-9 and float(cycle.checks.energy_closure) < 1e-6
    assert set(cycle.work) == {"drive", "gravity", *EVERY}
    balance = sum(float(work) for name, work in cycle.work.items())
    assert abs(balance) < 1e-8 * max(abs(float(work)) for work in cycle.work.values())
    assert jnp.isfinite(cycle.delta)


BAD = {  # text, key, parts of the message
    "no values": (ROW.replace("values", "#"), "loads[0].values", "missing", "a list of quantities"),
    "a force where a torque": (ROW.replace('"2 N m"', '"2 N"'), "loads[0].values[1]", "a force where a torque", ""),
    "a torque where a force": (JUMP.replace('"3 N"', '"3 N m"'), "loads[0].values[2]", "a torque where a force", ""),
    "fewer angles": (JUMP.replace('"0 deg", ', ""), "loads[0]", "3 angles and 4 values", "as many values"),
    "angles out of order": (
        JUMP.replace('"90 deg", "90', '"90 deg", "80'),
        "loads[0].angles[2]",
        "does not exceed",
        "in increasing order",
    ),
    "angle without unit": (JUMP.replace('"0 deg"', "5"), "loads[0].angles[0]", "an angle without a unit", "deg"),
    "positions over the crank": (ROW + 'positions = ["1 mm"]\n', "loads[0].positions", "has no effect", "change over"),
    "angles over a stroke": (STROKE + 'angles = ["1 deg"]\n', "loads[0].angles", "has no effect", "delete angles"),
    "no positions": (STROKE.replace("positions", "#"), "loads[0].positions", "missing", "as many values"),
    "one way only": (STROKE.replace("coming", "#"), "loads[0].coming", "missing, while going is given", "add coming"),
    "ways and values": (STROKE + 'values = ["0 N", "1 N"]\n', "loads[0].going", "given, and values too", "both senses"),
    "ways over the crank": (
        ROW.replace("values", "going"),
        "loads[0].going",
        "one value for each angle",
        "write values",
    ),
    "turns over a stroke": (STROKE + "cycle_turns = 1\n", "loads[0].cycle_turns", "has no effect", "delete it"),
    "a strange abscissa": (ROW + 'over = "time"\n', "loads[0].over", "not one of the choices", '"crank"'),
    "both elements": (STROKE.replace('"D" }', '"D", link = "rod2" }'), "loads[0].over", "both a point and a link", ""),
    "a method": (ROW + 'method = "spline"\n', "loads[0].method", "not one of the choices", '"cubic"'),
    "an unknown key": (ROW + 'value = ["1 N"]\n', "loads[0].value", "not a known key", "values"),
    "turns that do not fit": (
        ROW + "cycle_turns = 2\n",
        "loads[0]",
        "is not a multiple of the period",
        "cycle_turns of the scene",
    ),
    "no slider": (
        STROKE.replace('{ point = "D" }', '{ point = "B" }'),
        "loads[0].over.point",
        "on no slider",
        "direction",
    ),
    "no bore": (AIR.replace("bore", "#"), "loads[0].bore", "missing", 'bore = "80 mm"'),
    "no head": (AIR.replace("head", "#"), "loads[0].head", "missing", ""),
    "head": (AIR.replace('"+"', '"top"'), "loads[0].head", "not one of the choices", '"+" or "-"'),
    "no pressure": (
        CRANK.replace("pressures", "#").replace("angles", "#"),
        "loads[0].pressures",
        "missing",
        "suction =",
    ),
    "no exponent": (AIR.replace("exponent", "#"), "loads[0].exponent", "missing", "1.3"),
    "two kinds of pressure": (AIR + 'pressures = ["1 bar"]\n', "loads[0].pressures", "suction too", "not both"),
    "angles and volumes": (
        VOLUME + 'angles = ["1 deg"]\n',
        "loads[0].volumes",
        "given, and angles too",
        "angles or volumes",
    ),
    "no clearance": (AIR.replace("clearance", "#"), "loads[0].clearance", "depends on the volume", "20 cm^3"),
    "clearance over the crank": (
        CRANK + 'clearance = "20 cm^3"\n',
        "loads[0].clearance",
        "has no effect",
        "volumes instead",
    ),
    "a length as a volume": (AIR.replace("20 cm^3", "20 mm"), "loads[0].clearance", "a length where a volume", ""),
    "the order of pressures": (
        AIR.replace('"6 bar"', '"0.5 bar"'),
        "loads[0].suction",
        "not below",
        "absolute pressures",
    ),
    "a negative pressure": (CRANK.replace('"5 bar"', '"-5 bar"'), "loads[0].pressures[1]", "negative", "absolute"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_keys_are_named(name):
    text, key, *parts = BAD[name]
    with pytest.raises(SceneError) as caught:
        one(text)
    message = str(caught.value)
    assert caught.value.key == key, message
    assert all(part in message for part in parts), message
    assert "\n" not in message and not re.search(r"[A-Z][a-z]+Error", message)
