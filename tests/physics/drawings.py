"""Random machines drawn by coordinates alone: links and joints at points, with no other data for their positions.

Linkages are the kinematic chains with four, six and eight links, with any ground and any joint as the drive; some of
their joints are sliders, on the frame or on links. Machines with gears are drawn in mesh.
"""

from __future__ import annotations

import cmath
import dataclasses
import functools
from collections.abc import Callable, Collection

import numpy as np

import linkjax as lj
from linkjax.groups import FRAME, Belt, Drive, GearPair, Guide, RackPair, Slot, Teeth
from linkjax.mechanism import Link, linkage
from linkjax.topology import blocks, freedom
from tests.physics.chains import driven_chains, links_of, named

PUSH = 0.05  # m, or rad: amplitude of a motion law
THIRD = 0.3  # of the linkages: those with a second slider


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A machine as drawn: positions of points (m), those of the frame, the pins of links, slots as (block, link of the
    guide, a point of that link, direction of the line in the drawing), the driving and the driven link with its sense,
    whether with a motion law, gears as (gear, other, mesh), and racks as (rack, gear, side)."""

    spots: dict[str, complex]
    fixed: tuple[str, ...]
    pins: dict[str, tuple[str, ...]]
    slots: tuple[tuple[str, str, str, float], ...]
    drive: tuple[str, str]
    turns: int
    law: bool
    gears: tuple[tuple[str, str, Teeth | Belt], ...] = ()
    racks: tuple[tuple[str, str, int], ...] = ()

    def size(self) -> float:
        """The largest distance between two points (m)."""
        spots = np.array(list(self.spots.values()))
        return float(np.abs(spots[:, None] - spots).max())

    def moved(self, turned: float, shifted: complex, mirrored: bool) -> tuple[Drawing, Callable[[complex], complex]]:
        """The drawing mirrored on the x axis, turned (rad) and shifted (m), and the same transformation for points."""
        sense = -1 if mirrored else 1

        def there(z: complex) -> complex:
            return (z.conjugate() if mirrored else z) * cmath.exp(1j * turned) + shifted

        slots = tuple((block, on, through, sense * lean + turned) for block, on, through, lean in self.slots)
        racks = tuple((rack, wheel, sense * side) for rack, wheel, side in self.racks)
        spots = {name: there(at) for name, at in self.spots.items()}
        return dataclasses.replace(self, spots=spots, slots=slots, turns=sense * self.turns, racks=racks), there

    def direction(self, link: str) -> float:
        """The angle of the axis of a link in the drawing (rad)."""
        if link == FRAME:
            return 0.0
        lean = next((lean for block, _, _, lean in self.slots if block == link), None)
        return cmath.phase(self.spots[self.pins[link][1]] - self.spots[self.pins[link][0]]) if lean is None else lean

    def _along(self, slot: tuple[str, str, str, float]) -> complex:
        """The drawn position of a block along and beside its guide (m)."""
        block, _, through, lean = slot
        return (self.spots[self.pins[block][0]] - self.spots[through]) * cmath.exp(-1j * lean)

    def built(self, measured: Collection[str] = (), longer: float = 1.0) -> lj.Mechanism:
        """The machine: no length, phase or start is given except the end of a motion law and the lengths of the links
        `measured`, multiplied by this factor."""
        blocks_ = {block for block, *_ in self.slots}
        links = {name: Link(mass=1.0, pins=pins) for name, pins in self.pins.items()}
        for name in (name for name in measured if len(self.pins[name]) > 1 and name not in blocks_):
            length = longer * abs(self.spots[self.pins[name][1]] - self.spots[self.pins[name][0]])
            links[name] = dataclasses.replace(links[name], length=length)
        slots = [
            Slot(slot[0], Guide(slot[2], slot[3] - self.direction(slot[1]), self._along(slot).imag, slot[1]))
            for slot in self.slots
        ]
        link, on = self.drive
        driven = next((slot for slot in self.slots if {slot[0], slot[1]} == {link, on}), None)
        if driven is not None:
            law = lj.Harmonic(None, self._along(driven).real + PUSH)
        else:
            law = lj.Harmonic(None, self.direction(link) - self.direction(on) + self.turns * PUSH) if self.law else None
        drive = Drive(link, on, "cw" if law is None and self.turns < 0 else "ccw", law=law)
        gears = [GearPair(wheel, to, mesh) for wheel, to, mesh in self.gears]
        racks = []
        for rack, wheel, side in self.racks:
            slot = next(slot for slot in self.slots if slot[0] == rack)
            off = ((self.spots[self.pins[wheel][0]] - self.spots[self.pins[rack][0]]) * cmath.exp(-1j * slot[3])).imag
            racks.append(RackPair(rack, wheel, abs(off), side))
            assert off * side > 0
        fixed = {name: (self.spots[name].real, self.spots[name].imag) for name in self.fixed}
        sketch = {name: (at.real, at.imag) for name, at in self.spots.items() if name not in fixed}
        return linkage(fixed, links, drive, slots, sketch, None, gears, racks)


@functools.cache
def _every(count: int) -> list:
    return driven_chains(count, at_ground=False)


def linkage_of(rng: np.random.Generator) -> Drawing:
    """A four-, six- or eight-bar, some of whose joints may slide, at random points, in random units of length."""
    while True:
        count = int(rng.choice([4, 6, 6, 8]))
        every = _every(count)
        chain, ground, edge = every[rng.integers(len(every))]
        sliders = [chain[i] for i in rng.permutation(len(chain))[: rng.integers(0, 2) + (rng.random() < THIRD)]]
        found = _with_sliders(chain, ground, edge, sliders, rng)
        if found is not None:
            return found


def _with_sliders(chain, ground: int, edge, sliders, rng: np.random.Generator) -> Drawing | None:
    """A chain with these joints as sliders; None if this is impossible or would not move."""
    names, letters = links_of(chain, ground), dict.fromkeys(sliders, "P")
    pairs = named(chain, ground, letters)
    drive = next(p for p in pairs if p.name == f"j{min(edge)}{max(edge)}")
    loose = freedom(names, pairs, drive)
    if loose.degrees != 1 or loose.redundant or not loose.driven:
        return None
    order = {name: i for i, part in enumerate(blocks(names, pairs, drive)) for name in part} | {FRAME: -1}
    scale = 10.0 ** rng.uniform(-3, 3)
    spots = {p.name: complex(*rng.uniform(-scale, scale, 2)) for p in pairs if p.letter == "R"}
    spots["ground"] = complex(*rng.uniform(-scale, scale, 2))
    fixed = tuple({p.name: 0 for p in pairs if p.letter == "R" and FRAME in p.ends} | {"ground": 0})
    held = [sorted(p.ends, key=lambda end: order[end]) for p in pairs if p.letter == "P"]  # the first one has the guide
    taken = [block for _, block in held]
    if len(set(taken)) < len(taken):
        return None
    pins = {}
    for name in names:
        own = [p.name for p in pairs if p.letter == "R" and name in p.ends]
        rng.shuffle(own)
        for k in range(max(0, (1 if name in taken else 2) - len(own))):  # a point that defines the position of the link
            own.append(f"e{name}{k}")
            spots[own[-1]] = complex(*rng.uniform(-scale, scale, 2))
        pins[name] = tuple(own)
    slots = tuple(
        (block, on, "ground" if on == FRAME else pins[on][0], float(rng.uniform(-3, 3))) for on, block in held
    )
    moved = drive.one if drive.other == FRAME or rng.random() < 0.5 else drive.other
    against = next(end for end in drive.ends if end != moved)
    moved, against = (moved, against) if moved != FRAME else (against, moved)
    if drive.letter == "P":
        moved, against = next((block, on) for on, block in held if {block, on} == set(drive.ends))
    elif any(end in taken and len(pins[end]) < 2 for end in (moved, against)):
        return None  # nothing defines the angle of such a block
    turns = int(rng.choice([1, -1]))
    return Drawing(spots, fixed, pins, slots, (moved, against), turns, bool(rng.random() < 0.3))


def geared(rng: np.random.Generator) -> Drawing:
    """A machine with gears, belts or a rack, of one of five kinds."""
    spots = {name: complex(*rng.uniform(-1, 1, 2)) for name in "ABCDEFGPQST"}
    teeth = Teeth((int(rng.integers(12, 60)), int(rng.integers(61, 90))), internal=bool(rng.random() < 0.3))
    mesh = Belt(0.03, float(rng.uniform(0.04, 0.06)), crossed=bool(rng.random() < 0.5)) if rng.random() < 0.3 else teeth
    turns, law = int(rng.choice([1, -1])), bool(rng.random() < 0.3)
    dyad = {"left": ("B", "P"), "right": ("C", "P")}
    five = {"crank": ("A", "B"), "wheel": ("D", "C"), **dyad}
    kind = int(rng.integers(5))
    if kind == 0:  # a five-bar with its cranks in mesh; any pin drives
        pins = five
        drive = [("crank", FRAME), ("wheel", FRAME), ("left", "right"), ("left", "crank")][rng.integers(4)]
        gears = (("wheel", "crank", mesh),) if rng.random() < 0.5 else (("crank", "wheel", mesh),)
        return _only(spots, "AD", pins, (), drive, turns, law, gears)
    if kind == 1:  # over an idler that is drawn by its pivot only
        pins = {**five, "idler": ("E",)}
        gears = (("idler", "crank", mesh), ("wheel", "idler", Teeth((40, 20))))
        return _only(spots, "ADE", pins, (), ("crank", FRAME), turns, law, gears)
    if kind == 2:  # a planet on a crank, around a gear of the frame, followed by a dyad
        pins = {"crank": ("A", "B"), "planet": ("B", "C"), "left": ("C", "P"), "right": ("D", "P")}
        return _only(spots, "AD", pins, (), ("crank", FRAME), turns, law, (("planet", FRAME, teeth),))
    if kind == 3:  # a sun gear drives planet and arm simultaneously
        pins = {"sun": ("A", "S"), "arm": ("A", "B"), "planet": ("B", "Q"), "left": ("Q", "P"), "right": ("D", "P")}
        gears = (("planet", "sun", Teeth((20, 40))), ("planet", FRAME, Teeth((20, 80), internal=True)))
        return _only(spots, "AD", pins, (), ("sun", FRAME), turns, law, gears[:: int(rng.choice([1, -1]))])
    # a four-bar whose rocker is a pinion, and its rack; or the rack drives
    lean, side = float(rng.uniform(-3, 3)), int(rng.choice([1, -1]))
    spots["U"] = spots["D"] + cmath.exp(1j * lean) * (rng.uniform(-1, 1) - 1j * side * rng.uniform(0.1, 0.5))
    pins = {"crank": ("A", "B"), "rod": ("B", "C"), "rocker": ("D", "C"), "rack": ("U",)}
    slots, racks = (("rack", FRAME, "G", lean),), (("rack", "rocker", side),)
    drive = ("rack", FRAME) if rng.random() < 0.3 else ("crank", FRAME)
    return dataclasses.replace(_only(spots, "ADG", pins, slots, drive, turns, law, ()), racks=racks)


def _only(spots, fixed: str, pins, slots, drive, turns: int, law: bool, gears) -> Drawing:
    """A drawing with the points that it needs."""
    used = {*fixed, *(p for own in pins.values() for p in own)}
    return Drawing({p: at for p, at in spots.items() if p in used}, tuple(fixed), pins, slots, drive, turns, law, gears)
