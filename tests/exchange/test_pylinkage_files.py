# pyright: reportArgumentType=false
"""Every kind of file that pylinkage writes: imported with usable names, drawn and moving as there, or refused."""

from __future__ import annotations

import contextlib
import json
import math
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pylinkage.dyads import to_mechanism
from pylinkage.exceptions import UnbuildableError
from pylinkage.mechanism import fourbar, mechanism_to_json

import linkjax as lj
from linkjax import StructureError
from linkjax._compile import compiled_soon
from linkjax.exchange import read_pylinkage
from linkjax.exchange._pylinkage_names import usable
from linkjax.kinematics import pose, prepared
from linkjax.scenes import SceneError, loads_text
from tests.exchange.pylinkage_files import (
    MECHANISMS,
    OMEGA,
    STEPS,
    bent,
    chebyshev,
    engine,
    now_four_bar,
    old_four_bar,
    stepped,
    written,
)

WRONGLY = ("builder-six-bar", "dyads-engine", "dyads-moving-guide", "triad")  # as pylinkage's own Mechanism steps them
MAKE = {**MECHANISMS, "dyads-engine": lambda: to_mechanism(engine()),
        "dyads-moving-guide": lambda: to_mechanism(engine(moving=True))}  # fmt: skip
USABLE = re.compile(r"[^\W\d_][\w-]{0,39}")
places = compiled_soon(lambda mechanism, phi: jax.vmap(lambda phi: pose(mechanism, phi).points)(phi))


def over(mechanism: lj.Mechanism, angles) -> dict[str, np.ndarray]:
    """Points at crank angles, shape (angles, 2)."""
    found = places(prepared(mechanism), jnp.asarray(angles))
    one = np.ones(len(angles))
    return {name: np.stack([p.r.x * one, p.r.y * one], axis=1) for name, p in found.items()}


def drawn_in(document) -> tuple[dict[str, np.ndarray], float]:
    """Where joints are drawn, and the size of the drawing."""
    at = {joint["id"]: np.array(joint["position"], dtype=float) for joint in document["joints"]}
    return at, max(float(np.hypot(*(a - b))) for a in at.values() for b in at.values())


def joints_of(document, read, angles) -> dict[str, np.ndarray]:
    """Our points by the ids of their joints."""
    found = over(read.mechanism, angles)
    return {joint["id"]: found[read.points.get(joint["id"], joint["id"])] for joint in document["joints"]}


@pytest.fixture(scope="module")
def imported():
    """A file of each kind with what was read, and our joints at crank angle zero and after each of its steps."""
    kept = {}

    def one(name: str):
        if name not in kept:
            document = written(MAKE[name]())
            read = read_pylinkage(document)
            kept[name] = document, read, joints_of(document, read, OMEGA * np.arange(STEPS + 1))
        return kept[name]

    return one


@pytest.mark.parametrize("name", list(MAKE))
def test_joints_begin_where_they_are_drawn_and_links_stay_as_long(name, imported):
    """The lengths that the drawing says are kept over the turn; guides of `to_mechanism` are no links."""
    document, read, ours = imported(name)
    drawn, size = drawn_in(document)
    for joint, at in drawn.items():
        np.testing.assert_allclose(ours[joint][0], at, rtol=0, atol=1e-9 * size, err_msg=joint)
    links = [link for link in document["links"] if not link["id"].endswith("_guide")]
    assert bent({**document, "links": links}, ours) < 1e-12 * size
    assert all(USABLE.fullmatch(p) for p in (*ours_names(read), *read.mechanism.links))


def phase(mechanism: lj.Mechanism) -> float:
    """The angle of the crank at crank angle zero (rad)."""
    assert isinstance(mechanism.driver, lj.Crank)
    return float(mechanism.driver.phase)


def ours_names(read) -> set[str]:
    return {*read.mechanism.fixed, *(p for link in read.mechanism.links.values() for p in link.point_names())}


@pytest.mark.parametrize("name", list(MAKE))
def test_joints_move_as_pylinkage_steps_them(name, imported):
    """To the digits of its solver, for every file whose links it keeps as long as they are."""
    document, _, ours = imported(name)
    size = drawn_in(document)[1]
    theirs, change = {}, math.inf
    with contextlib.suppress(UnbuildableError, ValueError):  # a line through two joints; a triad of a ternary link
        theirs, change = stepped(document)
    if change > 1e-9 * size:
        assert name in WRONGLY
        return
    for joint, at in theirs.items():
        np.testing.assert_allclose(at, ours[joint][1:], rtol=0, atol=1e-9 * size, err_msg=joint)


@pytest.mark.parametrize(("name", "moving"), [("dyads-engine", False), ("dyads-moving-guide", True)])
def test_slides_move_as_pylinkages_linkage_steps_them(name, moving, imported):
    """Its Linkage knows lines through two joints, which its Mechanism has no word for."""
    linkage, (document, _, ours) = engine(moving), imported(name)
    size = drawn_in(document)[1]
    found = np.array([list(step) for step in linkage.step(STEPS)], dtype=float)
    for i, component in enumerate(linkage.components):
        np.testing.assert_allclose(found[:, i], ours[component.name][1:], rtol=0, atol=1e-9 * size)


def test_groups_are_found(imported):
    wanted = {
        "fourbar": "I1(crank) → II1(coupler, rocker)",
        "slider_crank": "I1(crank) → II2(rod, rod_1_block)",
        "builder-six-bar": "I1(crank) → II1(coupler, rocker) → II1(rod, lever)",
        "builder-two-rods": "I1(crank) → II2(rod, link_0_rod_1_block) → II1(link, rocker)",
        "by-hand": "I1(crank) → II1(A_link, rocker)",
        "triad": "I1(crank) → III3(leg_1, leg_2, leg_3, plate)",
        "dyads-strider": "I1(C_driver) → II1(D_link1, D_link2)",
        "dyads-moving-guide": "I1(A_driver) → II1(C_link1, C_link2) → {II1(E_link1, E_link2); II2(S_link1, S_block)}",
    }
    assert {name: imported(name)[1].mechanism.formula() for name in wanted} == wanted


def test_what_is_renamed(imported):
    assert imported("fourbar")[1].points == {
        "crank.motor_ground.A": "crank_motor_ground_A",
        "coupler.0_crank.tip": "coupler_0_crank_tip",
        "coupler.1_rocker.0": "coupler_1_rocker_0",
        "ground.D_rocker.1": "ground_D_rocker_1",
    }
    assert imported("by-hand")[1][1:] == ({}, {"A": "A_link"}, ())
    assert imported("by-hand")[1].mechanism.links["rocker"].centre_name == "S3"
    assert imported("by-hand")[1].mechanism.links["A_link"].centre_name == "S2_2"
    assert imported("dyads-strider")[1][1:] == ({}, {}, ())
    document, read, _ = imported("dyads-unnamed")
    assert read.points == {joint["id"]: f"P{joint['id']}" for joint in document["joints"]}


def test_names_stay_apart_and_short():
    """Two names that would become one, one that is too long, a block's, and one that is nothing but a sign."""
    document = written(fourbar(1.0, 3.5, 2.5, 3.8))
    old = {joint["id"]: new for joint, new in zip(document["joints"], ("a.b", "a_b", "a b", "%"), strict=True)}
    text = json.dumps(document)
    for one, other in old.items():
        text = text.replace(one, other)
    document = json.loads(text)
    document["links"][2]["id"], document["links"][3]["id"] = "x" * 50, "frame"
    read = read_pylinkage(document)
    assert read.points == {"a.b": "a_b_2", "a b": "a_b_3", "%": "P_"}
    assert read.links == {"x" * 50: "x" * 40, "frame": "frame_link"}
    assert ours_names(read) == {"a_b", "a_b_2", "a_b_3", "P_"}


@pytest.mark.parametrize("name", ["A", "é-1_b", "x" * 40, "x" * 41, "1a", "_a", "a.b", "", "a\n", "²", "frame"])
def test_usable_names_are_those_of_scene_files(name):
    text = f"speed = 1.0\n[fixed]\n{json.dumps(name)} = [0.0, 0.0]\n"
    with pytest.raises(SceneError) as refused:  # for its name, or because there is nothing else in it
        loads_text(text)
    assert usable(name) == (refused.value.problem != "not a usable name")


# ---- where the driver begins


def test_a_driver_begins_where_it_is_drawn():
    document = written(fourbar(1.0, 3.5, 2.5, 3.8, initial_angle=0.7))
    del document["links"][1]["initial_angle"]
    assert phase(lj.from_pylinkage(document)) == pytest.approx(0.7, abs=1e-15)
    document["links"][1]["initial_angle"] = 0.7 + 4 * math.pi
    assert phase(lj.from_pylinkage(document)) == pytest.approx(0.7, abs=1e-15)
    document["links"][1]["initial_angle"] = 0.7005  # 5e-4 of the crank, which is a quarter of the drawing
    assert phase(lj.from_pylinkage(document)) == pytest.approx(0.7, abs=1e-15)


def test_an_initial_angle_that_disagrees_with_the_drawing():
    document = written(fourbar(1.0, 3.5, 2.5, 3.8, initial_angle=0.7))
    document["links"][1]["initial_angle"] = 0.72
    says = r"crank: initial_angle is 0.72 rad, but 'coupler.0_crank.tip' is drawn at 0.7 rad; delete initial_angle"
    with pytest.raises(StructureError, match=says):
        lj.from_pylinkage(document)


def test_a_file_written_while_the_machine_moves(imported):
    """Its initial angle is that of the beginning, its joints are drawn some steps later."""
    _, read, _ = imported("stepped")
    assert read.notes == ("crank: starts where it is drawn, 7 steps after its initial_angle of 0.2 rad",)
    assert imported("fourbar")[1].notes == ()


@pytest.mark.parametrize("initial", [None, 0.545, 0.2, 1.09])
def test_an_arc_driver_oscillates_over_its_arc(initial):
    """Between the ends of its arc, from where it is drawn; at each angle of the crank as pylinkage has it there."""
    document = chebyshev(initial)
    drawn, size = drawn_in(document)
    read = read_pylinkage(document)
    assert read.notes == ("crank: moves between 0.66 and 1.75 rad as a cosine, not at constant speed",)
    ours = joints_of(document, read, np.linspace(0, 2 * math.pi, 361))
    for joint, at in drawn.items():
        np.testing.assert_allclose(ours[joint][0], at, rtol=0, atol=1e-9 * size)
    tip = next(joint for joint in drawn if "crank.tip" in joint)
    angles = np.unwrap(np.arctan2(ours[tip][:, 1], ours[tip][:, 0]))
    assert angles.min() == pytest.approx(0.66, abs=2e-4) and angles.max() == pytest.approx(1.75, abs=2e-4)
    assert angles.min() > 0.66 - 1e-12 and angles.max() < 1.75 + 1e-12
    if initial is None:  # cosine from end to end
        np.testing.assert_allclose(angles, 1.205 - 0.545 * np.cos(np.linspace(0, 2 * math.pi, 361)), atol=1e-12)
    assert bent(document, ours) < 1e-12 * size


def test_an_arc_driver_that_disagrees_with_its_drawing():
    document = chebyshev(None)
    driver = document["links"][1]
    driver["arc_start"], driver["initial_angle"] = 0.9, None
    with pytest.raises(StructureError, match=r"drawn at 0.66 rad, outside the arc from 0.9 to 1.75 rad; correct arc"):
        lj.from_pylinkage(document)
    driver["arc_start"] = 1.8
    with pytest.raises(StructureError, match=r"crank: oscillates from arc_start 1.8 rad to arc_end 1.75 rad; wr"):
        lj.from_pylinkage(document)


def test_a_slide_off_its_line():
    document = written(MECHANISMS["slider_crank"]())
    slider = next(joint for joint in document["joints"] if joint["type"] == "prismatic")
    slider["line_point"] = [0.0, 0.3]
    with pytest.raises(
        StructureError, match=r"rod.1: is drawn at \(.*\), 0.0986394 from its line through \[0.0, 0.3\]"
    ):
        lj.from_pylinkage(document)


# ---- older linkages


def test_older_linkages_move_as_their_components_do_now():
    document, linkage = old_four_bar(), now_four_bar()
    read = read_pylinkage(json.dumps(document))
    assert read.mechanism.formula() == "I1(A_driver) → II1(C_link1, C_link2) → II2(S_link1, S_block)"
    assert read.points == {"1404": "P1404"}
    ours = over(read.mechanism, OMEGA * np.arange(STEPS + 1))
    found = np.array([[c.position for c in linkage.components], *linkage.step(STEPS)], dtype=float)
    for i, component in enumerate(linkage.components):
        name = read.points.get(component.name, component.name)
        np.testing.assert_allclose(found[:, i], ours[name], rtol=0, atol=1e-12, err_msg=name)


# ---- the command


def test_the_command_imports_what_pylinkages_constructors_write(call, tmp_path):
    """Names are the same as in Python, those that change are printed; what is written is shown and reads back."""
    path = tmp_path / "four.json"
    mechanism_to_json(fourbar(1.0, 3.5, 2.5, 3.8), path)
    code, out, _ = call("import", path)
    assert code == 0
    assert out.splitlines()[0].startswith("renamed: ") and "crank.motor_ground.A -> crank_motor_ground_A" in out
    mechanism, again = lj.load(tmp_path / "four.toml").mechanism, lj.from_pylinkage(path.read_text())
    assert mechanism.formula() == again.formula() and set(mechanism.links) == set(again.links)
    assert set(mechanism.fixed) == set(again.fixed)
    assert phase(mechanism) == phase(again)
    code, out, _ = call("show", tmp_path / "four.toml")
    assert code == 0 and "coupler_0_crank_tip" in out


def test_rounding_near_zero_is_written_as_zero(call, tmp_path):
    """A point drawn where the crank's pin is, which the pose has at 1e-32 m: no scene file holds that."""
    document = written(MECHANISMS["hypergraph-strider"]())
    next(joint for joint in document["joints"] if joint["id"] == "F")["position"] = [0.0, -1.0]
    path = tmp_path / "file.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert call("import", path)[0] == 0
    assert lj.load(tmp_path / "file.toml").mechanism.formula() == "I1(C_crank) → II1(D_link0, D_link1)"


@pytest.mark.parametrize("name", ["triad", "dyads-moving-guide", "builder-six-bar", "stepped", "arc", "old"])
def test_the_command_writes_scenes_that_read_back(name, call, tmp_path, imported):
    document = chebyshev(0.2) if name == "arc" else old_four_bar() if name == "old" else imported(name)[0]
    path = tmp_path / "file.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    code, out, err = call("import", path)
    assert code == 0, err
    read = read_pylinkage(document)
    assert all(note in out for note in read.notes)
    assert lj.load(tmp_path / "file.toml").mechanism.formula() == read.mechanism.formula()
