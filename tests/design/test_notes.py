"""What an optimum says about links whose mass stays as given while their length is a design variable."""

import io
from types import SimpleNamespace

import pytest
from rich.console import Console

import linkjax as lj
from linkjax import Link, Vec
from linkjax._display import Numbers
from linkjax.analysis import analyse
from linkjax.cli import _print_optimum
from linkjax.design import document
from linkjax.design._text import notes
from linkjax.design._texts import settled_free

WHILE = 'as given while the length changes (mass_properties = "fixed")'


def four_bar(coupler: Link, rocker: Link) -> lj.Scene:
    links = {"crank": Link(length=0.1), "coupler": coupler, "rocker": rocker}
    groups = [lj.Crank("crank", "A", "B"), lj.RRR(("coupler", "rocker"), "B", "D", "C", 1)]
    return lj.Scene(lj.Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.4, 0.0)}, links, groups), speed=20.0)


HEAVY = {"length": 0.36, "mass": 3.0, "points": {"E": Vec(0.1, 0.2), "F": Vec(0.1, -0.2)}}
BAR = Link(length=0.26, mass=2.0, inertia=0.01, centre=Vec(0.13, 0.0))
ALL = {f"links.{name}.length": "± 5 %" for name in ("crank", "coupler", "rocker")}


@pytest.mark.parametrize(
    ("coupler", "free", "says"),
    [
        (Link(**HEAVY), ALL, [f"coupler, rocker: mass, centre and inertia stay {WHILE}"]),
        (Link(**HEAVY, uniform=True), ALL, [f"rocker: mass, centre and inertia stay {WHILE}",
         f"coupler: the mass stays {WHILE}; centre and inertia follow it (uniform)"]),
        (Link(**HEAVY, mass_properties="stretched", reference_length=0.36), ALL,
         [f"rocker: mass, centre and inertia stay {WHILE}"]),
        (Link(**HEAVY), {"links.crank.length": {"range": "± 5 %", "linked": ["links.coupler.length"]}},
         [f"coupler: mass, centre and inertia stay {WHILE}"]),
        (Link(**HEAVY), {"links.coupler.length": "± 5 %", "links.coupler.mass": "1 to 5 kg"}, []),
        (Link(**HEAVY), {"links.coupler.points.E.across": "± 5 %", "links.crank.length": "± 5 %"}, []),
    ],
)  # fmt: skip
def test_links_with_fixed_masses_are_named(coupler, free, says):
    scene = four_bar(coupler, BAR)
    problem = SimpleNamespace(scene=scene, variables=settled_free(scene, free), start=(), lower=(), upper=())
    assert list(notes(problem, scene)) == says


def test_a_plate_whose_corners_lose_their_order_is_named():
    """The corner E passes below F, so that the outline B-E-C-F crosses itself."""
    scene = four_bar(Link(**HEAVY, uniform=("B", "F", "C", "E")), BAR)
    after = lj.design.changed(scene, {"links.coupler.points.E.along": 0.5, "links.coupler.points.E.across": -0.3})
    problem = SimpleNamespace(scene=scene, variables=[], start=[], lower=[], upper=[])
    assert notes(problem, scene) == ()
    (note,) = notes(problem, after)
    assert note.startswith("coupler: the edges ") and "of the plate cross in the optimised design" in note


def test_the_line_is_printed_and_in_the_document(monkeypatch):
    """Once, for all starts: in `print(optimum)`, in the JSON document and in the output of the command."""
    link = Link(length=0.1, mass=2.0, inertia=0.01, centre=Vec(0.03, 0.01))
    mechanism = lj.Mechanism({"O": Vec(0.0, 0.0)}, {"crank": link}, [lj.Crank("crank", "O", "A")], lj.Flywheel(1.0))
    scene = lj.Scene(mechanism, speed=20.0)
    free = {"links.crank.length": "± 5 %", "flywheel.inertia": "1 to 2 kg m^2"}
    best = lj.optimise(scene, free, "flywheel.inertia", starts=2)
    line = f"crank: mass, centre and inertia stay {WHILE}"
    assert best.notes == (line,)
    assert str(best).count(line) == 1
    cycle = analyse(scene, angles=8)
    data = document(best, cycle, cycle)
    assert data["notes"] == [line]
    out = io.StringIO()
    monkeypatch.setattr(_print_optimum, "console", Console(file=out, width=200))
    _print_optimum.print_optimum(data, Numbers(), 1.0)
    assert out.getvalue().count(f"note: {line}") == 1


@pytest.mark.parametrize(("bounds", "side"), [("2 to 3 kg m^2", "lower"), ("0 to 0.5 kg m^2", "upper")])
def test_a_value_outside_its_range_is_told(bounds, side):
    mechanism = lj.Mechanism(
        {"O": Vec(0.0, 0.0)}, {"crank": Link(length=0.1)}, [lj.Crank("crank", "O", "A")], lj.Flywheel(1.0)
    )
    best = lj.optimise(lj.Scene(mechanism, speed=20.0), {"flywheel.inertia": bounds}, "flywheel.inertia")
    assert best.notes == (
        f"flywheel.inertia of the given scene is not within its range; the first start is at its {side} bound",
    )
