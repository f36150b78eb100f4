# pyright: reportArgumentType=false
"""Files of every kind that pylinkage writes, created by pylinkage itself, and their joints as pylinkage steps them."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pylinkage.actuators import Crank
from pylinkage.assur import Edge, LinkageGraph, Node, NodeRole
from pylinkage.assur.mechanism_conversion import graph_to_mechanism
from pylinkage.components import Ground
from pylinkage.dimensions import Dimensions, DriverAngle
from pylinkage.dyads import FixedDyad, RRPDyad, RRRDyad, to_mechanism
from pylinkage.hypergraph import from_sim_linkage
from pylinkage.hypergraph import to_mechanism as of_hypergraph
from pylinkage.mechanism import (
    DriverLink,
    GroundJoint,
    GroundLink,
    Link,
    Mechanism,
    MechanismBuilder,
    RevoluteJoint,
    TrackerJoint,
    fourbar,
    mechanism_from_dict,
    mechanism_to_dict,
    slider_crank,
)
from pylinkage.simulation import Linkage

STEPS = 72
OMEGA = math.tau / STEPS


def six_bar() -> Mechanism:
    """A four-bar with a ternary coupler that carries a rod and a lever, with trackers and a point of the frame."""
    builder = MechanismBuilder("six-bar")
    builder.add_ground_link("ground", ports={"A": (0.0, 0.0), "D": (4.0, 0.0), "G": (5.0, 3.0), "mark": (1.0, -1.0)})
    builder.add_driver_link("crank", length=1.0, motor_port="A", omega=-OMEGA, initial_angle=0.7)
    builder.add_ternary_link("coupler", port_geometry={"B": (0.0, 0.0), "C": (3.5, 0.0), "E": (2.0, 1.5)})
    builder.add_link("rocker", length=2.5)
    builder.add_link("rod", length=3.0)
    builder.add_quaternary_link("lever", {"F": (0.0, 0.0), "G": (2.5, 0.0), "H": (1.0, 1.0), "I": (3.0, -1.0)})
    for one, two in (("crank.tip", "coupler.B"), ("coupler.C", "rocker.0"), ("rocker.1", "ground.D"),
                     ("coupler.E", "rod.0"), ("rod.1", "lever.F"), ("lever.G", "ground.G")):  # fmt: skip
        builder.connect(one, two)
    builder.add_point_tracker("middle", "coupler.B", "coupler.C", distance=1.75)
    builder.add_point_tracker("out", "rod.1", "rod.0", distance=0.5, angle=0.8)
    return builder.set_branch("coupler.C", 1).set_branch("rod.1", 1).build()


def inline_slider() -> Mechanism:
    """A slider that carries the rod of a rocker: two bars at one prismatic joint."""
    builder = MechanismBuilder("two rods")
    builder.add_ground_link("ground", ports={"O": (0.0, 0.0), "R": (7.0, 2.0)})
    builder.add_driver_link("crank", length=1.0, motor_port="O", omega=OMEGA, initial_angle=0.4)
    builder.add_link("rod", length=3.0).add_link("link", length=3.0).add_link("rocker", length=2.5)
    builder.add_slide_axis("rail", through=(0.0, 0.3), direction=(2.0, 0.1))
    builder.connect("crank.tip", "rod.0").connect_prismatic("rod.1", "rail").connect("rod.1", "link.0")
    return builder.connect("link.1", "rocker.0").connect("rocker.1", "ground.R").set_branch("rod.1", 1).build()


def by_hand() -> Mechanism:
    """Joints and links as a user writes them: the initial angle at its default, a link with the name of a joint, a
    point with the name that linkjax gives to a mass centre, and a tracker at rest."""
    ground = [GroundJoint("O1", position=(0.0, 0.0)), GroundJoint("O2", position=(3.0, 0.0))]
    a, b = RevoluteJoint("A", position=(1.0, 0.0)), RevoluteJoint("B", position=(3.0, 2.0))
    still = TrackerJoint("still", position=(1.0, 1.0))
    mark = TrackerJoint("S2", ref_joint1_id="A", ref_joint2_id="B", distance=0.5, angle=0.2)
    mark.update_position(a.position, b.position)
    links = [
        GroundLink("frame", joints=list(ground)),
        DriverLink("crank", joints=[ground[0], a], motor_joint=ground[0], angular_velocity=OMEGA),
        Link("A", joints=[a, b]), Link("rocker", joints=[ground[1], b]),
    ]  # fmt: skip
    return Mechanism("by hand", joints=[*ground, a, b, still, mark], links=links)


def strider() -> Linkage:
    """One side of the strider of pylinkage's examples: points fixed to the frame and to moving links."""
    a, y = Ground(0.0, 0.0, name="A"), Ground(0.0, 1.0, name="Y")
    b = FixedDyad(a, y, distance=2.0, angle=-math.pi / 4, name="B")
    c = Crank(a, radius=1.0, angular_velocity=OMEGA, initial_angle=-math.pi / 2, name="C")
    d = RRRDyad(b, c.output, distance1=1.8, distance2=2.6, x=2.25, y=0.0, name="D")
    d.reload()
    f = FixedDyad(c.output, d, distance=1.4, angle=-math.pi - 0.2, name="F")
    return Linkage([a, y, b, c, d, f], name="strider")


def unnamed() -> Linkage:
    """Components without names, for which pylinkage uses numbers."""
    o1, o2 = Ground(0.0, 0.0), Ground(3.0, 0.0)
    crank = Crank(o1, radius=1.0, angular_velocity=OMEGA)
    return Linkage([o1, o2, crank, RRRDyad(crank.output, o2, distance1=3.0, distance2=2.0)], name="unnamed")


def engine(moving: bool = False) -> Linkage:
    """A slider on the line through two points: of the frame, or of the rocker of a four-bar."""
    o, crank = (point := Ground(0.0, 0.0, name="O")), Crank(point, radius=1.0, angular_velocity=OMEGA, name="A")
    if not moving:
        one, two = Ground(0.0, -0.3, name="L1"), Ground(5.0, 0.2, name="L2")
        slider = RRPDyad(crank.output, one, two, distance=3.0, x=3.9, y=0.0, name="S")
        slider.reload()
        return Linkage([o, one, two, crank, slider], name="engine")
    ground = Ground(4.0, 0.0, name="D")
    pin = RRRDyad(crank.output, ground, distance1=3.5, distance2=2.5, name="C")
    other = RRRDyad(pin, Ground(8.0, 1.0, name="R"), distance1=4.0, distance2=3.0, name="E")
    slider = RRPDyad(Ground(5.0, 2.0, name="Q"), ground, pin, distance=3.5, x=3.0, y=3.0, name="S")
    slider.reload()
    return Linkage([o, ground, other.anchor2, slider.revolute_anchor, crank, pin, other, slider], name="moving guide")


def triad() -> Mechanism:
    """A crank and a triad: a group of class III, which pylinkage stores as edges."""
    places = {"O": (0.0, 0.0), "A": (0.3, 0.0), "P": (5.3, 4.2), "Q": (4.3, 6.9), "X": (4.9, 1.4), "Y": (3.8, 1.8),
              "Z": (4.8, 3.0)}  # fmt: skip
    ground = {name: GroundJoint(name, position=places[name]) for name in "OPQ"}
    pins = ground | {name: RevoluteJoint(name, position=places[name]) for name in "AXYZ"}
    bars = {"leg.1": "AX", "leg.2": "PY", "leg.3": "QZ", "plate": "XYZ"}
    links = [Link(name, joints=[pins[pin] for pin in ends]) for name, ends in bars.items()]
    crank = DriverLink("crank", joints=[pins["O"], pins["A"]], motor_joint=ground["O"], angular_velocity=OMEGA)
    return Mechanism(
        "triad", joints=list(pins.values()), links=[GroundLink("g", joints=[*ground.values()]), crank, *links]
    )


def of_graph() -> Mechanism:
    """A Watt six-bar of nodes and edges."""
    graph = LinkageGraph(name="graph")
    for name, role in zip(("O1", "O2", "O3", "A", "B", "C"), "GGGDNN", strict=True):
        graph.add_node(Node(name, role={"G": NodeRole.GROUND, "D": NodeRole.DRIVER, "N": NodeRole.DRIVEN}[role]))
    for ends in ("O1 A", "A B", "B O2", "B C", "C O3"):
        one, two = ends.split()
        graph.add_edge(Edge(one + two, source=one, target=two))
    places = {"O1": (0.0, 0.0), "O2": (4.0, 0.0), "O3": (7.0, 1.0), "A": (0.0, 1.0), "B": (3.0, 2.0), "C": (6.0, 3.0)}
    sizes = {
        f"{a}{b}": math.dist(places[a], places[b])
        for a, b in (e.split() for e in ("O1 A", "A B", "B O2", "B C", "C O3"))
    }
    return graph_to_mechanism(graph, Dimensions(places, {"A": DriverAngle(OMEGA)}, sizes))


def stepped_mechanism(times: int = 7) -> Mechanism:
    """A four-bar that was written during its motion: its initial angle is that of the beginning."""
    mechanism = fourbar(1.0, 3.5, 2.5, 3.8, omega=OMEGA, initial_angle=0.2)
    for _ in mechanism.step(times):
        pass
    return mechanism


def of_sim(linkage: Linkage) -> Mechanism:
    """Via a hypergraph."""
    return of_hypergraph(*from_sim_linkage(linkage))


MECHANISMS: dict[str, Callable[[], Mechanism]] = {
    "fourbar": lambda: fourbar(1.0, 3.5, 2.5, 3.8, omega=OMEGA),
    "fourbar-other": lambda: fourbar(1.0, 3.5, 2.5, 3.8, omega=-OMEGA, initial_angle=2.5, branch=0, name=""),
    "slider_crank": lambda: slider_crank(1.0, 3.0, OMEGA, 0.3, (0.0, 0.2), (3.0, -0.5)),
    "builder-six-bar": six_bar, "builder-two-rods": inline_slider, "by-hand": by_hand, "triad": triad,
    "graph": of_graph, "stepped": stepped_mechanism,
    "dyads-unnamed": lambda: to_mechanism(unnamed()), "dyads-strider": lambda: to_mechanism(strider()),
    "hypergraph-strider": lambda: of_sim(strider()), "hypergraph-engine": lambda: of_sim(engine()),
}  # fmt: skip


def stepped(document: dict[str, Any], steps: int = STEPS) -> tuple[dict[str, np.ndarray], float]:
    """Joints over the turn as pylinkage steps them from their drawn positions, shape (steps, 2), and the length changes
    of its own links: its solver steps some mechanisms incorrectly."""
    theirs = mechanism_from_dict(document)
    theirs.set_joint_positions(theirs.get_joint_positions())  # its drivers read their angles from the drawing
    found = np.array([list(step) for step in theirs.step(steps)], dtype=float)
    at = {joint.id: found[:, i] for i, joint in enumerate(theirs.joints)}
    return at, bent(document, at)


def bent(document: dict[str, Any], at: dict[str, np.ndarray]) -> float:
    """The largest change of a distance between two joints of one link from the drawing, over all positions."""
    drawn = {joint["id"]: joint["position"] for joint in document["joints"]}
    pairs = [(a, b) for link in document["links"] for a, b in itertools.combinations(link["joints"], 2)]
    return max(np.abs(np.hypot(*(at[a] - at[b]).T) - math.dist(drawn[a], drawn[b])).max() for a, b in pairs)


def written(mechanism: Mechanism) -> dict[str, Any]:
    """The content that pylinkage writes to a file."""
    return json.loads(json.dumps(mechanism_to_dict(mechanism)))


def chebyshev(initial: float | None) -> dict[str, Any]:
    """The straight-line mechanism of pylinkage's examples, its arc slightly shorter than up to its toggle positions."""
    arc = 0.66, 1.75
    builder = MechanismBuilder("Chebyshev").add_ground_link("ground", ports={"O1": (0, 0), "O2": (100, 0)})
    builder.add_arc_driver_link("crank", 125, "O1", 0.05, *arc, None if initial is None else arc[0] + initial)
    builder.add_link("coupler", 50).add_link("rocker", 125).connect("crank.tip", "coupler.0")
    builder.connect("coupler.1", "rocker.0").connect("rocker.1", "ground.O2")
    return written(builder.add_point_tracker("middle", "coupler.0", "coupler.1").set_branch("coupler.1", 1).build())


def old_four_bar() -> dict[str, Any]:
    """As pylinkage 0.9 wrote it: positions are rough, anchors that were written as positions are inline."""
    return {
        "name": "old", "solve_order": None,
        "joints": [
            {"type": "Static", "name": "O", "x": 0, "y": 0.0},
            {"type": "Crank", "name": "A", "x": 0.0, "y": 1.0, "joint0": {"ref": "O"}, "distance": 1.0, "angle": OMEGA},
            {"type": "Revolute", "name": "C", "x": 3.0, "y": 2.0, "joint0": {"ref": "A"},
             "joint1": {"inline": True, "type": "Static", "x": 4.0, "y": 0.0, "name": "1404"},
             "distance0": 3.5, "distance1": 2.5},
            {"type": "Fixed", "name": "F", "x": 1.0, "y": 1.0, "joint0": {"ref": "A"}, "joint1": {"ref": "C"},
             "distance": 2.0, "angle": 0.5},
            {"type": "Static", "name": "L", "x": 0.0, "y": -1.0}, {"type": "Static", "name": "R", "x": 5.0, "y": 4.0},
            {"type": "Linear", "name": "S", "x": 4.0, "y": 3.0, "joint0": {"ref": "F"}, "joint1": {"ref": "L"},
             "joint2": {"ref": "R"}, "revolute_radius": 2.6},
        ],
    }  # fmt: skip


def now_four_bar() -> Linkage:
    """The same with the present components of pylinkage."""
    o, d, left, right = (Ground(x, y, name=n) for x, y, n in ((0, 0, "O"), (4, 0, "1404"), (0, -1, "L"), (5, 4, "R")))
    a = Crank(o, 1.0, OMEGA, math.pi / 2, name="A")
    c = RRRDyad(a.output, d, 3.5, 2.5, x=3.0, y=2.0, name="C")
    c.reload()
    f = FixedDyad(a.output, c, 2.0, 0.5, name="F")
    s = RRPDyad(f, left, right, 2.6, x=4.0, y=3.0, name="S")
    s.reload()
    return Linkage([o, d, left, right, a, c, f, s], name="now")
