"""Chains that are rigid by the count of their joints, but move because of their special dimensions.

Places are found by the Gauss-Newton method for all links and joints simultaneously, including the redundant ones.

The count itself uses random dimensions (`topology`). If it gives no mobility, all joints are closed by least squares at
some positions of the drive, with the true dimensions: a linkage that moves then does so because of these, and links
that only join two others are taken as redundant until one degree of freedom remains.
Source: Gogu, Mobility of mechanisms: a critical review, 2005, on the limits of counting joints.
"""

from __future__ import annotations

import cmath
import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from linkjax.groups import FRAME, AbstractGroup, RedundantLink, RedundantSlider
from linkjax.topology import Pair, freedom

STEPS = (0.05, 0.1)  # rad, or of the size: trial displacements of the drive
CLOSED = 1e-9  # of the size: largest closure error of a closed chain
ROUNDS = 30
H = 1e-7  # of the size: step of finite differences
NEARLY = 0.2  # of its length: largest misfit of a link that is meant to fit
Standing = Mapping[str, tuple[complex, complex]]  # place and direction of each link
MOST = 3  # redundant links searched for


def passive_links(drawing, found: Sequence[Pair], driven: Pair) -> list[str]:
    """Redundant links: without them the chain has the one degree of freedom of the drive, and it moves with them, too.
    Empty if it does not move. The links given last are tried first."""
    if any(pair.letter == "G" for pair in found) or not _places(drawing, found, driven):
        return []
    gone = next(_dispensable(drawing, found, driven, MOST), ())
    return [link for link in drawing.links if link in gone]


def misfit(drawing, found: Sequence[Pair], driven: Pair) -> tuple[str, float, float, float] | None:
    """A link that nearly fits as a redundant link: its name, its length, and the smallest and largest distance of its
    ends while the other links move a little (m)."""
    geared = any(pair.letter == "G" for pair in found)
    for (link,) in () if geared else _dispensable(drawing, found, driven, 1):
        rest, own = drawing.without((link,)), drawing.places(link)
        first, second = list(own)[:2] if len(own) > 1 else (FRAME, FRAME)
        spans = [
            abs(at[first] - at[second]) for at in _places(rest, rest.pairs(), driven) if {first, second} <= set(at)
        ]
        length = abs(own[second] - own[first]) if spans else 0.0
        if spans and max(abs(span - length) for span in spans) < NEARLY * length:
            return link, length, min(spans), max(spans)
    return None


def dispensable(drawing, found: Sequence[Pair], driven: Pair) -> list[str]:
    """Single links whose removal leaves the chain with the one degree of freedom of the drive."""
    return [link for (link,) in _dispensable(drawing, found, driven, 1)]


def _dispensable(drawing, found: Sequence[Pair], driven: Pair, most: int) -> Iterator[tuple[str, ...]]:
    """Sets of at most `most` links whose removal leaves the chain with the one degree of freedom of the drive."""
    spare = [link for link in reversed(drawing.links) if link not in driven.ends and _bridges(link, found)]
    for count in range(1, most + 1):
        for gone in itertools.combinations(spare, count):
            rest = drawing.without(gone)
            after = freedom(list(rest.links), rest.pairs(), driven)
            if after.degrees == 1 and after.driven and not after.redundant:
                yield gone


def _bridges(link: str, found: Sequence[Pair]) -> bool:
    """Whether a link joins just two others, by two pins, or by a pin and as the block of a slot."""
    held = [pair for pair in found if link in pair.ends]
    return sorted(p.letter for p in held) in (["R", "R"], ["P", "R"]) and all(
        pair.one == link for pair in held if pair.letter == "P"
    )


def passive_group(link: str, drawing) -> AbstractGroup:
    """The group of a redundant link."""
    pins = drawing.links[link].pins
    guide = next((slot.guide for slot in drawing.slots if slot.block == link), None)
    return RedundantLink(link, pins[0], pins[1]) if guide is None else RedundantSlider(link, pins[0], guide)


def _places(drawing, found: Sequence[Pair], driven: Pair) -> list[dict[str, complex]]:
    """The places of the points of all links at some positions of the drive at which all joints close, near the drawn
    one; empty where the drive cannot move."""
    names = list(drawing.links)
    places = {name: drawing.places(name) for name in names}
    start = np.zeros((len(names), 3))
    for row, name in zip(start, names, strict=True):
        axis, pin = drawing.axis(name), drawing.links[name].pins[0]
        origin = drawing.spot(pin, name) - places[name][pin] * axis
        row[:] = origin.real, origin.imag, cmath.phase(axis)
    size = max((abs(at) for each in places.values() for at in each.values()), default=0.0) or 1.0

    def world(here: Standing, body: str, point: str) -> complex:
        if body == FRAME:
            return drawing.spots[point]
        return here[body][0] + places[body][point] * here[body][1]

    def opened(x: np.ndarray, drive: float) -> np.ndarray:
        here = {
            name: (complex(a, b), cmath.exp(1j * t)) for name, (a, b, t) in zip(names, x.reshape(-1, 3), strict=True)
        }
        rows: list[float] = []
        value = 0.0
        for pair in found:
            turn = here[pair.other][1] if pair.other != FRAME else 1 + 0j
            if pair.letter == "R":
                gap = world(here, pair.one, pair.name) - world(here, pair.other, pair.name)
                rows += [gap.real, gap.imag]
            else:
                guide = next(slot.guide for slot in drawing.slots if slot.block == pair.one)
                along = turn * cmath.exp(1j * float(guide.along))
                off = (here[pair.one][0] - world(here, pair.other, guide.through)) / along
                rows += [off.imag - float(guide.offset), size * (here[pair.one][1] / along).imag]
                if pair == driven:
                    value = off.real / size
        if driven.letter == "R":
            one, other = (here[end][1] if end != FRAME else 1 for end in driven.ends)
            value = cmath.phase(one / other / moved)
        return np.array([*rows, size * (value - drive)])

    def points(x: np.ndarray) -> dict[str, complex]:
        at = {name: complex(a, b) for name, (a, b, _) in zip(names, x.reshape(-1, 3), strict=True)}
        turn = {name: cmath.exp(1j * t) for name, t in zip(names, x[2::3], strict=True)}
        own = {p: at[name] + z * turn[name] for name in names for p, z in places[name].items()}
        return own | {p: drawing.spots[p] for p in drawing.fixed}

    moved = 1 + 0j
    x = _closest(lambda x: opened(x, 0.0)[:-1], start.ravel(), size)
    first = float(opened(x, 0.0)[-1] / size)
    if driven.letter == "R":  # measured from the present angle, to stay away from half a turn
        moved, first = cmath.exp(1j * first), 0.0
    for sign in (1, -1):
        ends = []
        for step in STEPS:
            y = _closest(lambda x, to=first + sign * step: opened(x, to), x, size)
            if np.abs(opened(y, first + sign * step)).max() < CLOSED * size:
                ends.append(y)
        if len(ends) == len(STEPS):
            return [points(y) for y in (x, *ends)]
    return []


def _closest(opened, x: np.ndarray, size: float) -> np.ndarray:
    """The position with the smallest closure error, from a nearby start."""
    for _ in range(ROUNDS):
        h = 1e-7 * np.where(np.arange(x.size) % 3 == 2, 1.0, size)
        slope = np.stack(
            [(opened(x + step) - opened(x - step)) / (2 * h[i]) for i, step in enumerate(np.diag(h))], axis=1
        )
        scale = np.where(np.arange(x.size) % 3 == 2, 1.0, size)
        move = np.linalg.lstsq(slope * scale, -opened(x), rcond=1e-9)[0] * scale
        most = np.max(np.abs(move / scale))
        x = x + move * min(1.0, 0.3 / most if most > 0 else 1.0)
        if most < 1e-13:
            break
    return x
