"""What `print` shows of scenes, mechanisms, cycles and optima, and the columns of `Cycle.table`."""

import dataclasses
import html
import itertools
import math
import re
from xml.etree import ElementTree

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax._display import aligned, number
from linkjax.analysis import document

DEGREES = 180 / math.pi
DELTA = "coefficient of speed fluctuation δ"
SHORT = "(traced numbers, or several designs)"


@pytest.fixture(scope="module")
def cycle():
    return lj.analyse(lj.load("slider-crank"), angles=36)


@pytest.fixture(scope="module")
def still():
    """A machine without any mass has kinematics and statics, and no actual motion."""
    return lj.analyse(lj.Scene(lj.four_bar(0.1, 0.3, 0.25, 0.28), speed=10.0), angles=36)


@pytest.fixture(scope="module")
def best():
    free = {"links.coupler.length": "± 8 %", "links.rocker.length": "± 8 %"}
    limits = ["links.coupler.length <= 370 mm"]
    return lj.optimise(lj.load("four-bar"), free, maximise="min_transmission_angle", limits=limits)


def cells(text: str) -> dict[str, list[str]]:
    """Lines of a table by their first cell, which ends where two spaces do."""
    rows = [[cell.strip() for cell in line.split("  ") if cell.strip()] for line in text.splitlines() if line]
    return {row[0]: row[1:] for row in rows}


def test_cells_are_aligned():
    assert aligned([("a", "b", "c"), ("long", "–", "")]) == ["a     b  c", "long  –"]


@pytest.mark.parametrize("name", lj.scene_names())
def test_a_scene_prints_what_it_holds(name):
    scene = lj.load(name)
    text, mechanism = str(scene), scene.mechanism
    rows, lines = cells(text), text.splitlines()
    assert lines[0] == scene.title and len(lines) <= 40 and "f64[" not in text
    assert rows["structure"] == [mechanism.formula()]
    assert rows["drive"][0].startswith(mechanism.driving_link)
    assert rows["speed"][0].startswith(f"{float(scene.speed) * 30 / math.pi:.6g} rpm")
    assert rows["cycle"][0].startswith(f"{scene.cycle_turns} turn")
    assert float(rows["gravity"][0].partition(", ")[2].partition(")")[0].replace("−", "-")) == float(scene.gravity.y)
    assert rows["flywheel"][0].startswith(f"{float(mechanism.flywheel.inertia):g} kg·m²")
    for point, at in mechanism.fixed.items():
        assert f"{point} ({1e3 * float(at.x):g}, {1e3 * float(at.y):g}) mm".replace("-", "−") in rows["fixed points"][0]
    for link in mechanism.link_names:
        length, body = float(mechanism.links[link].length), mechanism.links[link].actual()
        assert rows[link][:2] == [f"{1e3 * length:.6g} mm" if length else "–", f"{float(body.mass):g} kg"]
    assert {load.name for load in scene.loads} <= set(rows)
    assert scene.loads or rows["load"] == ["–"]


def test_drives_and_loads_are_described():
    rows = cells(str(lj.load("hay-press")))
    assert rows["drive"] == ["crank rotates counter-clockwise, phase 0.000°"]
    assert rows["hay"] == ["30 kN against the motion", "rocker S5", "90° to 335°"]
    assert rows["flywheel"] == ["0 kg·m², target δ 0.15"]
    mechanism = lj.load("hay-press").mechanism
    for law, text in (
        (lj.Harmonic(0.1, 0.4), f"crank oscillates between {0.1 * DEGREES:.3f}° and {0.4 * DEGREES:.3f}° (harmonic)"),
        (
            lj.Spline((0.0, 1.0, 3.0), (0.2, 0.5, 0.3)),
            f"crank oscillates between {0.2 * DEGREES:.3f}° and {0.5 * DEGREES:.3f}° (spline through 3 positions)",
        ),
    ):
        driver = dataclasses.replace(mechanism.groups[0], law=law)
        alone = lj.Mechanism(mechanism.fixed, {"crank": mechanism.links["crank"]}, (driver,))
        assert cells(str(lj.Scene(alone, speed=3.0)))["drive"] == [text]
    heavy = lj.load("hay-press", {"links.crank.counterweights.W": {"mass": "3 kg", "at": "-100 mm"}})
    assert cells(str(heavy))["W"] == ["crank", "3 kg", "(−100, 0) mm", "0 kg·m²"]


def test_rolling_bodies_print_a_table():
    machine = lj.load_rolling("rolling-eccentric")
    rows, lines = cells(str(machine)), str(machine).splitlines()
    assert lines[0] == machine.title and len(lines) == 7
    assert rows["inner"] == ["40.0000000 mm"] and rows["drive"] == ["inner ring at 300 rpm, outer ring held"]
    assert str(several(machine)).endswith(SHORT)


def test_a_mechanism_prints_its_structure():
    mechanism = lj.load("hay-press").mechanism
    rows = cells(str(mechanism))
    assert rows["structure"] == [mechanism.formula()]
    assert rows["mobility"] == ["W = 3 n - 2 p = 3·5 - 2·7 = 1"]
    assert rows["crank"] == ["I1", "R", "A (crank on frame)", "–"]
    assert rows["rod, slider"] == [
        "II2",
        "RRP",
        "B (rod on crank), slider.guide (slider on frame)",
        "D (rod on slider)",
    ]


def several(tree):
    """Two of a kind, as `jax.vmap` returns them."""
    return jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), tree)


@pytest.mark.parametrize("what", ["scene", "mechanism", "cycle"])
def test_traced_batched_and_missing_numbers_give_a_short_line(what, request):
    made = {"scene": lambda: lj.load("hay-press"), "mechanism": lambda: lj.load("hay-press").mechanism}
    it, seen = made[what]() if what in made else request.getfixturevalue("cycle"), []

    def prints(tree):
        seen.extend((str(tree), f"{tree}"))
        return jax.tree.leaves(tree)[0]

    jax.eval_shape(jax.jit(prints), it)
    jax.eval_shape(jax.vmap(prints), several(it))
    prints(several(it))
    for put in (object(), None, jax.ShapeDtypeStruct((), float)):
        seen.append(str(jax.tree.map(lambda _, put=put: put, it)))
    seen.append(str(jax.tree.map(lambda leaf: leaf[None], it)))
    if what == "mechanism":  # its structure has no numbers
        assert set(seen) == {str(it)}
    else:
        assert len(set(seen)) == 1 and seen[0].endswith(SHORT) and "\n" not in seen[0]
    assert "f64[" in repr(it) and "f64[2]" in repr(several(it))


def test_a_cycle_prints_its_motion_and_peaks(cycle):
    data, text = document(cycle), str(cycle)
    rows, run = cells(text), data["motion"]
    assert text.startswith("Compressor: The machine runs.\n") and len(text.splitlines()) <= 40
    assert rows["mean crank speed"] == ["960.000 rpm (time mean)"]
    assert math.isclose(float(rows[DELTA][0].partition(" ± ")[0]), run["delta"], abs_tol=2 * run["delta_error"])
    assert rows[DELTA][0].partition(" ± ")[2]
    assert rows["mean drive torque"] == [f"{number(run['mean_drive_torque'], 6)} N·m, constant over the cycle"]
    assert rows["flywheel"] == ["0.35 kg·m²"]
    assert rows["flywheel for δ = 0.02"] == [f"{number(data['flywheel']['for_target_delta'], 6)} kg·m²"]
    assert rows["energy per cycle"] == ["supplied", "absorbed"] and rows["sum"][0] == rows["sum"][1]
    for name in ("drive", "gas"):
        works = data["energies"][name].values()
        assert [float(cell.split(" ")[0]) for cell in rows[name]] == pytest.approx(list(works), rel=1e-5)
    names = [name for name in data["peaks"] if "_constant_speed" not in name]
    for name in names:
        label = name.removeprefix("peak_")
        value, at, constant, there = rows[label if label.startswith("reaction") else label.replace("_", " ")]
        head, dot, element = name.partition(".")
        for shown, peak in ((value, name), (constant, f"{head}_constant_speed{dot}{element}")):
            size, unit = shown.split(" ")
            wanted = data["peaks"][peak]["value"]
            assert unit.lstrip("k") == ("N·m" if name.endswith(("torque", "moment")) else "N")
            assert math.isclose(float(size.replace("−", "-")) * (1e3 if unit[0] == "k" else 1), wanted, rel_tol=1e-5)
        assert at in ("–", f"{data['peaks'][name]['angle'] * DEGREES:.3f}°") and there[-1] in "°–"
    stroke = data["strokes"]["P"]
    assert rows["P"][:2] == [f"{number(1e3 * stroke['value'], 6)} mm", f"{stroke['time_ratio']:.4f}"]
    assert rows["rod-piston"][1] == f"{data['groups']['rod-piston']['margin']:.4g}"


def test_a_notebook_shows_the_machine(cycle, still):
    """Its pins are as far apart as the links are long, its curves between their values; tables are those of text."""
    scene = lj.load("slider-crank", {"title": "Pump & <valve>"})
    shown = dataclasses.replace(cycle, scene=scene)._repr_html_()
    assert shown.endswith(f"<pre>{html.escape(str(dataclasses.replace(cycle, scene=scene)))}</pre>")
    machine, *curves = (ElementTree.fromstring(found) for found in re.findall(r"<svg.*?</svg>", shown))
    space = "{http://www.w3.org/2000/svg}"
    assert "Pump & <valve>" in machine.attrib["aria-label"]
    pins = np.asarray([[float(each.attrib[a]) for a in ("cx", "cy")] for each in machine.iter(f"{space}circle")])
    crank, rod = (float(np.hypot(*(b - a))) for a, b in itertools.pairwise(pins))
    links = scene.mechanism.links
    assert rod / crank == pytest.approx(
        float(links["rod"].length / links["crank"].length), rel=2e-3
    )  # tenths of a pixel
    told = [each.text or "" for curve in curves for each in curve.iter(f"{space}text")]
    named = [text.split(":")[0] for text in told if ":" in text]
    assert named == ["crank speed", "drive torque at constant speed"]
    assert len(re.findall("<svg", still._repr_html_())) == 2  # without actual motion there is no curve of the speed
    assert several(cycle)._repr_html_() is None
    seen: list[str | None] = []

    def traced(it: lj.Cycle) -> jax.Array:
        seen.append(it._repr_html_())
        return it.angles

    jax.eval_shape(traced, cycle)
    assert seen == [None]


def test_a_cycle_without_actual_motion_prints_why(still):
    text = str(still)
    rows = cells(text)
    assert still.missing.reason in text.splitlines()[0]
    assert rows[DELTA] == ["–"] and rows["mean drive torque"][0].startswith("–") and "mean power" not in rows
    assert rows["crank speed"] == [f"{number(300 / math.pi, 6)} rpm, constant"]
    assert "peak" not in rows  # neither masses nor loads act


def test_a_cycle_that_cannot_be_assembled_prints_its_margins():
    scene = lj.Scene(lj.four_bar(0.3, 0.3, 0.25, 0.28), speed=10.0)
    cycle = lj.analyse(scene, angles=36, throw=False)
    text, data = str(cycle), document(cycle)
    assert "cannot be assembled" in text.splitlines()[0] and "shaking_force" not in text
    assert cells(text)["coupler-rocker"][1].startswith("−")
    assert (data["dead_centres"], data["strokes"], data["swings"], data["peaks"]) == ([], {}, {}, {})


def test_an_optimum_prints_before_and_after(best):
    rows, goal = cells(str(best)), "maximise min_transmission_angle"
    assert str(best).startswith("Crank-rocker, optimised\n")
    assert rows["result"] == [f"optimal, KKT residual {best.kkt_residual:.1e}"]
    assert rows[goal] == [f"{number(each * DEGREES, 6)}°" for each in (best.objective_before, best.objective)]
    for name, bounds in (("links.coupler.length", (331.2, 388.8)), ("links.rocker.length", (239.2, 280.8))):
        line = next(line for line in str(best).splitlines() if line.startswith(name))
        both = [f"{number(1e3 * value, 6)} mm" for value in best.variables[name]]
        assert line.split("  ")[0] == name
        assert [cell.strip() for cell in line.split("  ")[1:] if cell][:4] == [*both, *(f"{b:g} mm" for b in bounds)]
    assert rows["min_margin"][2] == "≥ 0.001"
    assert "≤ 370 mm" in str(best)
    active = [label for label, limit in best.limits.items() if limit.multiplier > 0]
    assert [label for label, row in rows.items() if row[-1:] == ["active"]] == active
    assert repr(best).startswith("Optimum(before=Scene(")
    worse = dataclasses.replace(best, feasible=False, violated=("min_margin",), conflicts=("min_margin",))
    rows = cells(str(worse))
    assert rows["result"][0].startswith("infeasible") and rows["conflicts"] == ["min_margin"]
    assert rows["min_margin"][-1] == "violated"


def test_the_table_holds_the_columns_of_the_document(cycle, still):
    data, table = document(cycle), cycle.table()
    assert all(isinstance(column, np.ndarray) and column.shape == (36,) for column in table.values())
    for name, column in {
        "crank_angle": data["angles"],
        "x_P": data["points"]["P"]["x"],
        "ddy_S2": data["points"]["S2"]["ddy"],
        "angle_rod": data["links"]["rod"]["angle"],
        "ddangle_rod": data["links"]["rod"]["dd"],
        "transmission_angle_rod_piston": data["groups"]["rod-piston"]["transmission_angle"],
        "torque_gas": data["reduced"]["torque_by_load"]["gas"],
        "speed": data["motion"]["speed"],
        "time": data["motion"]["time"],
        "fx_piston_guide_piston": data["forces"]["reactions"]["piston.guide"]["piston"]["fx"],
        "drive_torque_constant_speed": data["forces_constant_speed"]["drive_torque"],
        "fy_shaking": data["forces"]["shaking"]["fy"],
        "fx_load_gas": data["loads"]["gas"]["fx"],
        "power_gas": data["loads"]["gas"]["power"],
        "power_gravity": data["loads"]["gravity"]["power"],
    }.items():
        np.testing.assert_array_equal(table[name], column)
    moved = {name for name in table if not name.endswith("_constant_speed")}
    assert {"speed", "acceleration", "time", "power", "drive_torque"} <= moved
    gone = {"speed", "acceleration", "time", "power", "drive_torque", "fx_A_crank"}
    assert not gone & set(still.table()) and "fx_A_crank_constant_speed" in still.table()


def test_names_of_columns_are_words_that_numpy_keeps(still, tmp_path):
    """Points of other names than words; two that would have one column are refused."""
    mechanism = lj.four_bar(0.1, 0.3, 0.25, 0.28, links={"coupler": lj.Link(points={"a-b, c": lj.Vec(0.1, 0.05)})})
    table = lj.analyse(lj.Scene(mechanism, speed=10.0), angles=36).table()
    assert "x_a_b__c" in table
    with (tmp_path / "it.csv").open("w") as file:
        np.savetxt(file, np.stack(list(table.values()), axis=1), delimiter=",", header=",".join(table), comments="")
    assert np.genfromtxt(tmp_path / "it.csv", delimiter=",", names=True).dtype.names == tuple(table)
    points = {name: lj.Vec(0.1, 0.05) for name in ("a-b", "a_b")}
    mechanism = lj.four_bar(0.1, 0.3, 0.25, 0.28, links={"coupler": lj.Link(points=points)})
    twice = lj.analyse(lj.Scene(mechanism, speed=10.0), angles=36)
    with pytest.raises(lj.StructureError, match=r"points.a_b.x: has the column name 'x_a_b', as points.a-b.x has"):
        twice.table()
    with pytest.raises(ValueError, match="the cycle is a batch of 2"):
        several(still).table()
    with pytest.raises(TypeError):
        compiled_soon(lambda it: it.table()["x_A"])(still)


def test_a_table_is_empty_where_the_machine_cannot_be_assembled():
    """A rod shorter than the crank: where sin φ is too large the columns are NaN, and the others hold true lengths."""
    links = {"crank": lj.Link(length=0.04), "rod": lj.Link(length=0.039), "slider": lj.Link(mass=1.0)}
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "slider", "B", "D", lj.Guide("A"))]
    scene = lj.Scene(lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups), speed=1.0)
    table = lj.analyse(scene, angles=72, throw=False).table()
    apart = 40 * np.abs(np.sin(table["crank_angle"])) > 39
    assert apart.any() and np.all(np.isnan(table["x_D"]) == apart)
    rod = np.hypot(table["x_D"] - table["x_B"], table["y_D"] - table["y_B"])
    np.testing.assert_allclose(rod[~apart], 0.039, rtol=1e-12)
