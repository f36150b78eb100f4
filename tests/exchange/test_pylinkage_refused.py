# pyright: reportArgumentType=false
"""Files of pylinkage that cannot be imported: each refused by name, in Python and by the command."""

from __future__ import annotations

import contextlib
import copy
import json
import math
import re

import pytest
from pylinkage.actuators import ArcCrank, Crank
from pylinkage.cam import FunctionProfile, HarmonicMotionLaw
from pylinkage.components import Ground, PointTracker
from pylinkage.dyads import RRRDyad, TranslatingCamFollower, to_mechanism
from pylinkage.hypergraph import from_mechanism
from pylinkage.hypergraph.serialization import graph_to_dict
from pylinkage.mechanism import fourbar
from pylinkage.simulation import Linkage

from linkjax import StructureError
from linkjax.exchange import read_pylinkage
from tests.exchange.pylinkage_files import MECHANISMS, OMEGA, chebyshev, old_four_bar, written


def with_component(kind: str) -> dict:
    """A four-bar of components with one that pylinkage's to_mechanism writes without links."""
    o, d = Ground(0.0, 0.0, name="O"), Ground(3.0, 0.0, name="D")
    crank = Crank(o, radius=1.0, angular_velocity=OMEGA, name="A")
    if kind == "arc":
        crank = ArcCrank(o, radius=1.0, angular_velocity=OMEGA, name="A")
    rocker = RRRDyad(crank.output, d, distance1=3.0, distance2=2.0, name="B")
    more = []
    if kind == "cam":
        profile = FunctionProfile(HarmonicMotionLaw())
        more = [TranslatingCamFollower(crank, profile, d, guide_angle=1.0, name="follower")]
    elif kind == "tracker":
        more = [PointTracker(crank.output, rocker, distance=0.5, angle=0.3, name="T")]
    return written(to_mechanism(Linkage([o, d, crank, rocker, *more], name=kind)))


def topology() -> tuple[dict, dict]:
    """A topology and its dimensions."""
    graph, dimensions = from_mechanism(fourbar(1.0, 3.5, 2.5, 3.8))
    return graph_to_dict(graph), dimensions.to_dict()


def tracking(one: str, two: str) -> dict:
    document = written(fourbar(1.0, 3.5, 2.5, 3.8))
    ids = {key: next(j["id"] for j in document["joints"] if key in j["id"]) for key in ("tip", "rocker.1", "motor")}
    tracker = {"id": "T", "type": "tracker", "position": [0.0, 0.0], "distance": 1.0, "angle": 0.0,
               "ref_joint1_id": ids.get(one, one), "ref_joint2_id": ids.get(two, two)}  # fmt: skip
    return {**document, "joints": [*document["joints"], tracker]}


def old(number: int, **keys) -> dict:
    """The older linkage with changed keys of a joint, alone."""
    document = old_four_bar()
    document["joints"][number] |= keys
    return document


NO_LINK = "is on no link; put it on a link, or delete it; pylinkage's to_mechanism omits"
BARE = "; build a Mechanism of the topology and its Dimensions with pylinkage's to_mechanism, and write that"


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: with_component("cam"), f"follower: {NO_LINK}"),
        (lambda: with_component("tracker"), f"T: {NO_LINK}"),
        (lambda: with_component("arc"), "links: there must be one driver, but there are: none; write one; pylinkage's "
                                        "to_mechanism omits the links of arc cranks and linear actuators"),
        (lambda: topology()[0], f"pylinkage: is a topology without dimensions (key 'nodes'){BARE}"),
        (lambda: topology()[1], f"pylinkage: holds dimensions without a topology (key 'node_positions'){BARE}"),
        (lambda: {"version": "1.0", "topologies": []}, "pylinkage: is a catalogue of topologies"),
        (lambda: {"instances": {}, "connections": []}, "pylinkage: is a hierarchy of topologies"),
        (lambda: tracking("tip", "rocker.1"), "T: tracks 'coupler.0_crank.tip' and 'ground.D_rocker.1', which are on no"
                                              " common link; delete it, or track two joints of one link"),
        (lambda: tracking("tip", "tip"), "T: tracks 'coupler.0_crank.tip' and 'coupler.0_crank.tip', which coincide"),
        (lambda: tracking("tip", "X"), "T: tracks 'X', which does not exist; known here: T"),
        (lambda: old(1, x=None), "A: x is None, which is not a finite number; write a number"),
        (lambda: old(1, angle=0), "A_driver: does not turn: angular_velocity is 0; write another angular velocity"),
        (lambda: old(2, type="RRRDyad"), "C: has the type 'RRRDyad'; known here: Static, Crank, Fixed, Revolute"),
        (lambda: old(2, distance0=9.0), "C: is out of reach of its anchors; correct its lengths or its anchors"),
        (lambda: old(2, joint0={"ref": "Z"}), "C: joint0 is 'Z', which does not exist; known here: A, C, F, L, O, R"),
        (lambda: old(2, joint0=None), "C: joint0 is None, which is not a joint; write e.g. {\"ref\": \"A\"}"),
        (lambda: old(2, joint0={"ref": "F"}), "C, F, S: are attached to each other, so none of them can be placed"),
        (lambda: old(2, name="A"), "A: is the name of two joints; give one of them another name"),
        (lambda: old(3, joint0={"ref": "O"}), "F: tracks 'O' and 'C', which are on no common link"),
        (lambda: old(6, joint1={"ref": "A"}), "S: slides along the line of 'A' and 'R', which are on no common link"),
    ],
)  # fmt: skip
def test_what_is_refused(make, says):
    with pytest.raises(StructureError, match=re.escape(says)):
        read_pylinkage(make())


def leaves(value, path=()):
    """Paths of everything in a document."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*path, key)
        yield from leaves(inner, (*path, key))


VALUES = [None, True, "", "A", "\ud800", {}, [], [0, 0], -1, 0.0, 1e300, 10**400, math.nan]


@pytest.mark.parametrize("name", ["builder-two-rods", "hypergraph-engine", "old", "arc"])
def test_broken_files_are_read_or_refused(name, rng):
    """Keys deleted and values exchanged, two at once: the only possible error is one that names an element."""
    document = old(0) if name == "old" else chebyshev(0.2) if name == "arc" else written(MECHANISMS[name]())
    paths, refused = list(leaves(document)), 0
    for _ in range(150):
        broken = copy.deepcopy(document)
        for number in rng.integers(len(paths), size=2):
            with contextlib.suppress(KeyError, IndexError, TypeError):
                place = broken
                for key in paths[number][:-1]:
                    place = place[key]
                if (which := int(rng.integers(len(VALUES) + 1))) < len(VALUES):
                    place[paths[number][-1]] = VALUES[which]
                else:
                    del place[paths[number][-1]]
        try:
            read_pylinkage(broken)
        except StructureError as error:
            assert error.problem and error.remedy
            refused += 1
    assert refused > 50


@pytest.mark.parametrize(
    "text", ["[" * 100000, "1" * 5000, '{"joints": [' + "1" * 5000 + "]}"], ids=["deep", "long", "in"]
)
def test_texts_that_no_parser_takes(text):
    with pytest.raises(StructureError, match=r"pylinkage: (is not JSON|is not valid JSON|has no lists)"):
        read_pylinkage(text)


def test_the_command_names_the_file(call, tmp_path):
    path = tmp_path / "far.json"
    document = written(fourbar(1.0, 3.5, 2.5, 3.8))
    document["links"][1]["initial_angle"] = 1.0
    path.write_text(json.dumps(document), encoding="utf-8")
    code, _, err = call("import", path)
    assert code == 2 and err.startswith(
        f"{path}: crank: initial_angle is 1 rad, but 'coupler.0_crank.tip' is drawn at 0"
    )
    document["links"][1]["initial_angle"] = 0.0
    document["joints"].append({"id": "S1", "type": "tracker", "position": [0.0, 0.0], "distance": 1e-40, "angle": 0.0,
                               "ref_joint1_id": document["links"][2]["joints"][0],
                               "ref_joint2_id": document["links"][2]["joints"][1]})  # fmt: skip
    path.write_text(json.dumps(document), encoding="utf-8")
    code, _, err = call("import", path)
    assert code == 2 and err.startswith(f"{path}: links.coupler.points.S1.along = ") and "<text>" not in err
    assert list(tmp_path.iterdir()) == [path]
    scene = path.rename(tmp_path / "scene.toml")
    code, _, err = call("import", scene)
    assert code == 2 and err.startswith(f"{scene}: is a scene file, not pylinkage's JSON; ")
