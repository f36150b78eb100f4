"""Every chain with up to eight links as a machine: random positions, masses and directions of sliders.

Positions are those drawn, rates those that the joints permit (one linear system for all links), and every link is in
equilibrium under its joint forces, its weight and its inertia.
"""

from __future__ import annotations

import cmath
import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.groups import FRAME, Drive, Guide, Slot
from linkjax.kinematics import pose
from linkjax.machine import ready
from linkjax.mechanism import Link, linkage
from linkjax.topology import Pair, blocks, rates
from tests.physics.chains import Chain, Edge, driven_chains, links_of, named, sliding

SPEED, ACCELERATION = 3.0, -4.0


class Made(NamedTuple):
    """A machine of a chain: its scene, positions of pins (m, complex), the sliding pair with a point and the direction
    of its line, and the driving pair with the link that it moves and its rate."""

    scene: lj.Scene
    spots: dict[str, complex]
    pairs: list[Pair]
    slider: tuple[Pair, str, float] | None
    drive: tuple[Pair, str, float]


def machine_of(chain: Chain, ground: int, edge: Edge, other: Edge | None, rng: np.random.Generator) -> Made:
    """Links and joints of a chain, of which the joint `other` slides, drawn at random positions."""
    first = f"j{edge[0]}{edge[1]}"
    names, pairs = links_of(chain, ground), named(chain, ground, {other: "P"} if other else {})
    drive = next(p for p in pairs if p.name == first)
    slider = next((p for p in pairs if p.letter == "P"), None)
    order = {name: i for i, part in enumerate(blocks(names, pairs, drive)) for name in part} | {FRAME: -1}
    # the first one carries the guide
    on, block = ("", "") if slider is None else sorted(slider.ends, key=lambda end: order[end])
    spots = {f"j{a}{b}": complex(*rng.uniform(-1, 1, 2)) for a, b in chain if (a, b) != other}
    fixed = {p: at for p, at in spots.items() if ground in map(int, p[1:])} or {"ground": 0.3 - 0.2j}
    lean, links = rng.uniform(-3, 3), {}
    for name in names:
        body = {
            "mass": rng.uniform(1, 3),
            "inertia": rng.uniform(0.1, 0.3),
            "centre": lj.Vec(*rng.uniform(-0.3, 0.3, 2)),
        }
        own = sorted((p for p in spots if name[1] in p), key=lambda p: p != first)  # a crank turns about its first pin
        if name == block:  # in the axes of its guide
            at = {p: (spots[p] - spots[own[0]]) * cmath.exp(-1j * lean) for p in own[1:]}
            points = {p: lj.Vec(z.real, z.imag) for p, z in at.items()}
            links[name] = Link(**body, pins=tuple(own), points=points)
            continue
        if len(own) == 1:  # its axis runs to a point to which nothing is attached
            own.append(f"e{name[1]}")
            spots[own[1]] = complex(*rng.uniform(-1, 1, 2))
        links[name] = Link(**body, pins=tuple(own))
    ways = {name: spots[link.pins[1]] - spots[link.pins[0]] for name, link in links.items() if name != block}
    slots, along = [], 0j
    moved = drive.one if drive.other == FRAME else drive.other
    if slider is not None:
        through = min(fixed) if on == FRAME else links[on].pins[0]
        from_there = (spots | fixed)[through]
        along = (spots[links[block].pins[0]] - from_there) * cmath.exp(-1j * lean)
        slots = [Slot(block, Guide(through, lean - cmath.phase(ways.get(on, 1.0)), along.imag, on))]
    if slider is drive:
        law = lj.Spline((0.0, 1.0, 3.0), (along.real, along.real + 0.02, along.real - 0.03))
        driven, pace = Drive(block, on, law=law), float(law.at(jnp.zeros(())).d)
    else:
        against = next(end for end in drive.ends if end != moved)
        start = cmath.phase(ways[moved] / ways.get(against, 1.0))
        driven, pace = Drive(moved, against, phase=start), 1.0
    made = linkage(
        {p: (at.real, at.imag) for p, at in fixed.items()}, links, driven, slots,
        {p: (at.real, at.imag) for p, at in spots.items() if p not in fixed},
    )  # fmt: skip
    line = None if slider is None else (slider, block, lean)
    return Made(lj.Scene(made, (), lj.Vec(0.0, -9.81), SPEED), spots, pairs, line, (drive, driven.link, pace))


def allowed_rates(made: Made, so_far: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Violation of the joints by rates of x, y and angle of every link, and the rates without violation, after all
    links have moved slightly by their rates `so_far`."""
    names = sorted(made.scene.mechanism.links)
    x, y, w = np.zeros((3, len(names))) if so_far is None else so_far.reshape((-1, 3)).T
    moved = {FRAME: lambda z: z}
    moved |= {name: lambda z, i=i: z + x[i] + 1j * y[i] + 1j * w[i] * z for i, name in enumerate(names)}
    of = {p: link for p, link in made.scene.mechanism.owners().items() if p in made.spots}
    lies = {p: moved[of[p]](at) for p, at in made.spots.items()}
    lies = {p: (at.real, at.imag, 0.0) for p, at in lies.items()}
    if made.slider is not None:
        slider, block, lean = made.slider
        line = moved[block](made.spots[made.scene.mechanism.links[block].pins[0]])
        lies[f"{slider.name} of {slider.one}"] = (line.real, line.imag, lean + w[names.index(block)])
    drive, driven, pace = made.drive
    matrix = rates(names, made.pairs, drive, lies)
    return matrix, np.linalg.solve(matrix, np.eye(len(matrix))[-1] * (pace if drive.one == driven else -pace))


@compiled_soon
def there(scene):
    """The pose at crank angle zero, and all forces."""
    scene = ready(scene)
    return pose(scene.mechanism, jnp.zeros(())), kinetostatics(scene, *map(jnp.asarray, (0.0, SPEED, ACCELERATION)))


def out_of_balance(scene: lj.Scene, here, forces) -> float:
    """The residual forces and moments on every link, relative to the largest force."""
    mechanism = scene.mechanism
    at = {joint.name: here.points[joint.point].r for group in mechanism.groups for joint in group.joints()}
    left, size = [], 1e-300
    for name, link in mechanism.links.items():
        body, centre, state = link.actual(), here.points[link.centre_name], here.links[name]
        pull_x = -float(body.mass) * (float(centre.ddr.x) * SPEED**2 + float(centre.dr.x) * ACCELERATION)
        pull_y = -float(body.mass) * (float(centre.ddr.y) * SPEED**2 + float(centre.dr.y) * ACCELERATION + 9.81)
        couple = -float(body.inertia) * (float(state.e) * SPEED**2 + float(state.w) * ACCELERATION)
        rows = [(pull_x, pull_y, couple, centre.r)]
        rows += [(float(f.fx), float(f.fy), float(f.moment), at[joint])
                 for joint, sides in forces.reactions.items() for on, f in sides.items() if on == name]  # fmt: skip
        if name == mechanism.driving_link and not any(joint.endswith(".drive") for joint in forces.reactions):
            rows.append((0.0, 0.0, float(forces.drive_torque), centre.r))  # cranks turn counter-clockwise
        sums = np.array([(x, y, m + float(r.x) * y - float(r.y) * x) for x, y, m, r in rows])
        left.append(np.abs(sums.sum(axis=0)).max())
        size = max(size, np.abs(sums).max())
    return max(left) / size


def check(made: Made, rounding: float):
    """Positions, rates and equilibrium."""
    mechanism, names = made.scene.mechanism, sorted(made.scene.mechanism.links)
    here, forces = there(made.scene)
    matrix, found = allowed_rates(made)
    step = 1e-6 / np.linalg.cond(matrix) / np.abs(found).max()
    bend = max(np.abs(allowed_rates(made, way * step * found)[1] - found).max() / step for way in (1, -1))
    allowed = rounding * (np.linalg.cond(matrix) * np.abs(found).max() + bend)  # bend: by the crank angle
    for i, name in enumerate(names):
        assert float(here.links[name].w) == pytest.approx(found[3 * i + 2], abs=allowed)
        for p in (p for p in mechanism.links[name].pins if p in made.spots):
            x, y, at = *found[3 * i : 3 * i + 2], here.points[p]
            np.testing.assert_allclose((at.r.x, at.r.y), (made.spots[p].real, made.spots[p].imag), atol=1e-12)
            moved = complex(x, y) + 1j * found[3 * i + 2] * made.spots[p]
            np.testing.assert_allclose((at.dr.x, at.dr.y), (moved.real, moved.imag), atol=allowed)
    assert out_of_balance(made.scene, here, forces) < 1e-12


CASES = [(count, i, *one) for count, each in ((4, 1), (6, 1), (8, 23))
         for i, one in list(enumerate(driven_chains(count, at_ground=False)))[::each]]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[1]}-{case[4]}-on-{case[3]}")
def test_every_chain_moves(case):
    """Every ground and every driving joint, also of moving links; of chains with eight links every 23rd."""
    count, number, chain, ground, edge = case
    check(machine_of(chain, ground, edge, None, np.random.default_rng((count, number))), 1e-15 if count < 8 else 1e-14)


SOON = [(4, 0), (6, 0), (6, 3)]  # whose groups have closed forms
LATER = [(4, 1), (4, 2), *((6, i) for i in range(54) if i not in (0, 3)), *((8, i) for i in range(0, 1377, 23))]


@pytest.mark.parametrize(("count", "number"), [*SOON, *(pytest.param(*c, marks=pytest.mark.slow) for c in LATER)])
def test_every_chain_with_a_slider_moves(count, number):
    """One joint of every chain is a slider, in any direction; of those with eight links every 23rd. The tolerance for
    rounding is that of all random machines: groups pass on positions with rounding errors."""
    chain, ground, edge, other = sliding(count)[number]
    check(machine_of(chain, ground, edge, other, np.random.default_rng((count, number))), 1e-15 if count < 8 else 1e-14)


PUSHED = [(count, i, *one) for count, each in ((4, 1), (6, 1), (8, 23))
          for i, one in list(enumerate(driven_chains(count, at_ground=True)))[::each]]  # fmt: skip


@pytest.mark.parametrize(
    "case", [PUSHED[0], *(pytest.param(case, marks=pytest.mark.slow) for case in PUSHED[1:])],
    ids=lambda case: f"{case[0]}-{case[1]}",
)  # fmt: skip
def test_every_chain_pushed_by_a_slide(case):
    """The driving joint itself is a slider with a motion law: a cylinder on the frame, or a driven block."""
    count, number, chain, ground, edge = case
    check(machine_of(chain, ground, edge, edge, np.random.default_rng((count, number, 1))), 1e-14)


def test_what_is_out_of_balance_is_seen():
    chain, ground, edge, other = sliding(4)[0]
    made = machine_of(chain, ground, edge, other, np.random.default_rng((4, 0)))
    here, forces = there(made.scene)
    mechanism = made.scene.mechanism
    links = {name: dataclasses.replace(link, mass=link.mass * (1 + 1e-9)) for name, link in mechanism.links.items()}
    heavier = dataclasses.replace(mechanism, links=links)
    assert out_of_balance(made.scene.with_mechanism(heavier), here, forces) > 1e-11
