# pyright: reportArgumentType=false
"""Random machines: a crank and up to four groups of class II, hung on anything that is there already.

The numbers of a composition decide what hangs where; those of a design its dimensions. What is drawn is tried out by
the oracle in NumPy and drawn anew where it cannot turn fully, with a margin.
"""

from __future__ import annotations

import math

import numpy as np

import linkjax as lj
from linkjax import PRP, RPP, RPR, RRP, RRR, Crank, Flywheel, Guide, Link, Mechanism, Vec
from tests.physics import oracle

ANGLES = np.linspace(0.0, 2 * math.pi, 120, endpoint=False)
MARGIN = 0.2
TRIES = 60
KINDS = ("RRR", "RRP", "RPR", "PRP", "RPP")


class Stuck(Exception):
    """No dimensions were found with which a composition turns fully."""


def composed(composition: int, design: int, groups: int) -> lj.Scene:
    """The design of this number of the composition of this number. Raises `Stuck` where none is found."""
    plan, dims = np.random.default_rng(composition), np.random.default_rng((composition, design))
    kinds = plan.choice(KINDS, groups)
    fixed = {"A": _point(dims, 0.1), "P": _point(dims, 0.5), "Q": _point(dims, 0.5)}
    links = {"crank": _link(dims, 0.1 * dims.uniform(0.7, 1.3), "K0")}
    made = [Crank("crank", "A", "B", int(plan.choice((1, -1))), dims.uniform(0, 6))]
    moving = {"B": "crank", "K0": "crank"}
    for number, kind in enumerate(kinds, 1):
        asked, (traces, _) = _ask(plan, fixed, moving), oracle.assemble(Mechanism(fixed, links, made), ANGLES)
        for _ in range(TRIES):
            group, new = _drawn(kind, number, dims, asked, traces)
            if _turns(fixed, links | new, [*made, group]):
                break
        else:
            raise Stuck(f"composition {composition}, design {design}: no {kind} as group {number}")
        links |= new
        made.append(group)
        for link, (origin, far) in group.pins().items():
            moving |= {p: link for p in (origin, far) if p in group.brings()}
            moving |= dict.fromkeys(new[link].points, link)
    gravity = Vec(dims.uniform(-2, 2), -9.81)
    mechanism = Mechanism(fixed, links, made, Flywheel(dims.uniform(0, 0.5)))
    return lj.Scene(mechanism, gravity=gravity, speed=dims.uniform(5, 40), title=f"{composition}.{design}")


def _point(rng, reach: float) -> Vec:
    return Vec(*rng.uniform(-reach, reach, 2))


def _link(rng, length: float, point: str) -> Link:
    """A link, or a block where the length is zero, with a marked point."""
    reach = length or 0.1
    inertia = rng.uniform(0.001, 0.02)
    return Link(length=length, mass=rng.uniform(0.3, 3), inertia=inertia, centre=_point(rng, 0.4 * reach),
                points={point: _point(rng, reach)})  # fmt: skip


def _ask(plan, fixed, moving):
    """What a group hangs on: a moving point and another one, or one of the frame; guides on the frame and on a link."""
    points = list(moving)
    one, two = plan.choice(points, 2, replace=False)
    to = plan.choice([p for p in (*fixed, *points) if p not in (one, "A")])
    on = [("frame", str(plan.choice(["P", "Q"])))]
    on.append((moving[two], str(two)))
    return str(one), str(to), on if plan.random() < 0.5 else on[::-1], int(plan.choice((1, -1)))


def _drawn(kind: str, number: int, rng, asked, traces):
    """A group of random dimensions, with its links."""
    one, to, (here, there), side = asked
    a, b, marks = f"a{number}", f"b{number}", (f"K{2 * number}", f"K{2 * number + 1}")

    def guide(on: tuple[str, str]) -> Guide:
        return Guide(on[1], rng.uniform(-3, 3), rng.uniform(-0.05, 0.05), on[0])

    def blocks(*lengths: float) -> dict[str, Link]:
        return {name: _link(rng, length, mark) for name, length, mark in zip((a, b), lengths, marks, strict=True)}

    if kind == "RRR":
        r = np.abs(traces[to] - traces[one])
        first, second = rng.uniform(0.5, 1.5, 2) * np.max(r)
        return RRR((a, b), one, to, f"G{number}", side), blocks(first, second)
    if kind == "RRP":
        return RRP(a, b, one, f"G{number}", guide(here), side), blocks(rng.uniform(0.3, 1.2), 0.0)
    if kind == "RPR":
        offset = rng.uniform(-0.03, 0.03)
        group = RPR(a, b, one, to, f"G{number}", side, offset)
        return group, blocks(rng.uniform(0.2, 0.5), 0.0)
    if kind == "PRP":
        return PRP((a, b), f"G{number}", (guide(here), guide(there)), side), blocks(0.0, 0.0)
    slot = rng.uniform(0.5, 2.6) * side
    return RPP(a, b, one, f"G{number}", guide(here), slot, rng.uniform(-0.05, 0.05)), blocks(0.0, 0.0)


def _turns(fixed, links, groups) -> bool:
    """Whether the last group stays clear of its dead positions, and within two metres, over a turn of the crank."""
    with np.errstate(invalid="ignore"):
        points, directions = oracle.assemble(Mechanism(fixed, links, groups), ANGLES)
    g = groups[-1]
    if not all(np.all(np.isfinite(points[p])) and np.max(np.abs(points[p])) < 2.0 for p in points):
        return False
    if isinstance(g, RRR):
        r, one, two = np.abs(points[g.to] - points[g.from_]), *(float(links[name].length) for name in g.links)
        return bool(np.min(one + two - r) > MARGIN * (one + two) and np.min(r - abs(one - two)) > MARGIN * (one + two))
    if isinstance(g, RRP):
        lean = (directions[g.link] / directions[g.block]).real
        return bool(np.min(np.abs(lean)) > 2 * MARGIN)
    if isinstance(g, RPR):
        return bool(np.min(np.abs(points[g.from_] - points[g.about])) > 0.1)
    if isinstance(g, PRP):
        return bool(np.min(g.side * (directions[g.blocks[1]] / directions[g.blocks[0]]).imag) > 2 * MARGIN)
    return True
