# pyright: reportArgumentType=false
"""Mechanisms to and from pylinkage's JSON, and stepped by pylinkage itself."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pylinkage.mechanism import mechanism_from_dict, mechanism_to_dict

import linkjax as lj
from linkjax import StructureError
from linkjax._compile import compiled_soon
from linkjax.exchange import from_pylinkage, to_pylinkage
from linkjax.kinematics import pose
from tests.library.examples import MADE
from tests.physics.machines import machine

STEPS = 48
FROM_SCENES = ("hay-press", "slider-crank", "four-bar", "clockwise", "two-on-one-crank", "coupler-points")
FROM_LIBRARY = ("watt-1", "watt-2", "stephenson-1", "stephenson-3", "toggle_press")
poses = compiled_soon(lambda mechanism, phi: jax.vmap(lambda phi: pose(mechanism, phi).points)(phi))


def known(name: str) -> lj.Mechanism:
    return MADE[name]() if name in FROM_LIBRARY else machine(name).mechanism


def places(mechanism: lj.Mechanism) -> dict[str, np.ndarray]:
    """Points over the turn, shape (STEPS, 2), the first one step after crank angle zero."""
    found = poses(mechanism, jnp.asarray(2 * math.pi / STEPS * np.arange(1, STEPS + 1)))
    count = np.ones(STEPS)
    return {name: np.stack([p.r.x * count, p.r.y * count], axis=1) for name, p in found.items()}


def stepped(document) -> dict[str, np.ndarray]:
    """Joints over the turn as pylinkage steps through it."""
    theirs = mechanism_from_dict(document)
    found = np.array([list(step) for step in theirs.step(STEPS)], dtype=float)
    return {joint.id: found[:, i] for i, joint in enumerate(theirs.joints)}


@pytest.mark.parametrize("name", [*FROM_SCENES, *FROM_LIBRARY])
def test_pylinkage_steps_to_the_same_places(name):
    """Its joints stand where our points do."""
    mechanism = known(name)
    document = json.loads(json.dumps(to_pylinkage(mechanism, STEPS)))
    theirs, ours = stepped(document), places(mechanism)
    marked = {p for link in mechanism.links.values() for p in link.points}
    assert {*mechanism.fixed, *marked} <= set(theirs) <= set(ours)
    for point, at in theirs.items():
        np.testing.assert_allclose(at, ours[point], rtol=0, atol=1e-12, err_msg=point)


@pytest.mark.parametrize("name", [*FROM_SCENES, *FROM_LIBRARY])
def test_there_and_back(name):
    """The same groups on the same names, the same motion; pylinkage's own reading and writing in between."""
    mechanism = known(name)
    document = to_pylinkage(mechanism, STEPS, "its name")
    back = from_pylinkage(json.dumps(mechanism_to_dict(mechanism_from_dict(document))))
    assert [(g.kind, set(g.link_names())) for g in back.groups] == [
        (g.kind, set(g.link_names())) for g in mechanism.groups
    ]
    assert set(back.links) == set(mechanism.links) and set(back.fixed) == set(mechanism.fixed)
    for link, own in mechanism.links.items():
        assert set(back.links[link].points) == set(own.points)
    ours, again = places(mechanism), places(back)
    for point in set(ours) & set(again) - {link.centre_name for link in mechanism.links.values()}:
        np.testing.assert_allclose(again[point], ours[point], rtol=0, atol=1e-13, err_msg=point)
    assert document["name"] == "its name"


def drawn() -> dict:
    """A four-bar with a coupler point and a slider on another, as one would write it by hand."""
    return {
        "name": "drawn", "ground": "g",
        "joints": [
            {"id": "A", "type": "ground", "position": [0.1, 0.2]},
            {"id": "D", "type": "ground", "position": [0.5, 0.2]},
            {"id": "B", "type": "revolute", "position": [0.1, 0.3]},
            {"id": "C", "type": "revolute", "position": [0.4, 0.5]},
            {"id": "E", "type": "revolute", "position": [0.2, 0.5]},
            {"id": "P", "type": "prismatic", "position": [-0.2, 0.3], "axis": [1.0, 1.0], "line_point": [0.0, 0.5]},
            {"id": "T", "type": "tracker", "position": [0, 0], "ref_joint1_id": "C", "ref_joint2_id": "B",
             "distance": 0.07, "angle": 0.4},
        ],
        "links": [
            {"id": "g", "type": "ground", "joints": ["A", "D"]},
            {"id": "crank", "type": "driver", "joints": ["A", "B"], "motor_joint": "A",
             "angular_velocity": -2 * math.pi / STEPS, "initial_angle": math.pi / 2},
            {"id": "rocker", "type": "link", "joints": ["D", "C"]},
            {"id": "coupler", "type": "link", "joints": ["B", "C", "E"]},
            {"id": "rod", "type": "link", "joints": ["E", "P"]},
        ],
    }  # fmt: skip


def test_read_what_was_drawn_by_hand():
    mechanism = from_pylinkage(drawn())
    assert mechanism.formula() == "I1(crank) → II1(rocker, coupler) → II2(rod, P_block)"
    crank = mechanism.driver
    assert isinstance(crank, lj.Crank) and crank.rotation == "cw" and float(crank.phase) == math.pi / 2
    assert float(mechanism.links["coupler"].length) == pytest.approx(math.hypot(0.3, 0.2), rel=1e-15)
    assert set(mechanism.links["coupler"].points) == {"E", "T"}
    theirs, ours = stepped(drawn()), places(mechanism)
    for point in "ABCDEPT":
        np.testing.assert_allclose(theirs[point], ours[point], rtol=0, atol=1e-12, err_msg=point)


def changed(*path, value) -> dict:
    """The drawn mechanism with one entry changed; `None` deletes it."""
    document = copy.deepcopy(drawn())
    place = document
    for key in path[:-1]:
        place = place[key]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return document


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ("{", "pylinkage: is not valid JSON: .* in line 1; write it with"),
        ("[]", "pylinkage: has no lists of joints and links"),
        (changed("joints", 2, "id", value=None), r"joints\[2\]: has no id"),
        (changed("joints", 2, "type", value="Crank"), "B: has the type 'Crank' of an older format; read"),
        (changed("joints", 3, "position", value=[None, None]), r"C: position is \[None, None\], which is not a pair"),
        (changed("joints", 3, "position", value=None), "C: has no position; write x and y"),
        (changed("joints", 6, "distance", value="far"), "T: distance is 'far', which is not a finite number; wr"),
        (changed("joints", 5, "axis", value=[1.0]), r"P: axis is \[1.0\], which is not a pair of coordinates"),
        (changed("links", 1, "motor_joint", value=["A"]), r"crank: motor_joint is \['A'\], which is not a string"),
        (changed("links", 3, "joints", value="BCE"), "coupler: joints is 'BCE', which is not a list of ids; write"),
        (changed("links", 2, "joints", value=None), "rocker: joints is None, which is not a list of ids; write the"),
        (changed("links", 3, "joints", 1, value="X"), "coupler: joint 'X' does not exist; known here: A"),
        (changed("links", 1, "type", value="link"), "links: there must be one driver, but there are: none"),
        (changed("joints", 2, "type", value="cam"), "B: has the type 'cam'; known here: ground, revolute, pris"),
        (changed("links", 2, "type", value="belt"), "rocker: has the type 'belt'; known here: ground, driver"),
        (changed("links", 2, "id", value="rod"), "rod: is the id of two links; give one of them another id"),
        (changed("links", 1, "angular_velocity", value=0.0), "crank: does not turn"),
        (changed("links", 1, "joints", value=["A", "B", "E"]), "crank: needs two joints, one of them its motor join"),
        (changed("links", 2, "joints", value=["C"]), "links: with the drive held, rocker, coupler, rod, P_"),
        (changed("links", 4, "joints", value=["E", "D"]), "P: is on no link; put it on a link, or delete it; pyl"),
        (changed("links", 2, "joints", value=["D", "C", "E"]), r"links: nothing can move \(.*\): the joints .* make"),
        (changed("joints", 6, "ref_joint2_id", value="D"), None),
        (changed("joints", 6, "ref_joint2_id", value="A"), "T: tracks 'C' and 'A', which are on no common link"),
        (changed("joints", 2, "position", value=[0.1, 0.2]), "crank: joints 'A' and 'B' coincide; move one of them"),
    ],
)  # fmt: skip
def test_what_cannot_be_read(document, says):
    if says is None:  # D and C are both on the rocker
        assert "T" in from_pylinkage(document).links["rocker"].points
        return
    with pytest.raises(StructureError, match=says):
        from_pylinkage(document)


def leaves(value, path=()):
    """Paths of everything in a document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from leaves(inner, (*path, key))


@pytest.mark.parametrize("value", [None, True, {}, [0, 0], math.nan], ids=str)
def test_whatever_stands_anywhere_it_is_read_or_refused(value):
    """With no other error than one that names an element."""
    for path in leaves(drawn()):
        with contextlib.suppress(StructureError):
            from_pylinkage(changed(*path, value=value))


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("quick-return", r"lever-die: pylinkage has no such group \(RPR\); use only rotating cranks, RRR"),
        ("scotch-yoke", r"yoke-die: pylinkage has no such group \(RPP\)"),
        ("swinging", r"crank: pylinkage has no such group \(a crank that follows a law\)"),
        ("moving-guides", r"rod-block: pylinkage has no such group \(a guide on a moving link\)"),
    ],
)
def test_what_cannot_be_written(name, says):
    with pytest.raises(StructureError, match=says):
        to_pylinkage(machine(name).mechanism)


def test_what_pylinkage_steps_wrongly():
    """It takes joints one by one where there are trackers, and C of two links with further joints from one of these."""
    mechanism = MADE["watt-1"]()
    to_pylinkage(mechanism)
    links = {name: mechanism.links[name] for name in mechanism.link_names}
    links["rod"] = dataclasses.replace(links["rod"], points={"T": lj.Vec(0.1, 0.1)})
    marked = lj.Mechanism(mechanism.fixed, links, mechanism.groups)
    with pytest.raises(StructureError, match="C: pylinkage would solve it from joints that are not solved yet; delete"):
        to_pylinkage(marked)


def test_points_on_blocks_cannot_be_written():
    block = lj.slider_crank(0.1, 0.3, links={"slider": lj.Link(points={"K": lj.Vec(0.1, 0.0)})})
    with pytest.raises(StructureError, match=r"links\.slider\.points\.K: pylinkage has no points on a slider"):
        to_pylinkage(block)
