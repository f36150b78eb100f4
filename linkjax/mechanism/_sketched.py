"""Checks of a sketch against the dimensions of links: wrong units, mistyped numbers, mirrored points.

Every link is compared by itself, by ratio and by the size of the drawing: a rough sketch passes, and a wrong number is
reported immediately, with the name of its link.
"""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Collection, Iterator
from typing import NamedTuple

from linkjax._types import known as number_of
from linkjax.groups import Drive
from linkjax.mechanism._mechanism import StructureError

OUT_OF_SCALE = 5.0  # ratio of sizes that no rough sketch has; a centimetre is 10 mm, an inch 25.4 mm
ROUGH = 0.1  # of the drawing's size: allowed error of a sketched point
UNSURE = 0.1  # of the way to one of two places: a sketch nearer to the middle selects neither
TRUE = 1e-3  # of the drawing's size: the same in a drawing that is true to scale
PLAIN = 0.05  # of the drawing's size: the smallest height of a triangle whose sense of rotation is clear
FAR = 20.0  # times the extent of all else: no pin that other links are attached to is so far away


class Span(NamedTuple):
    """Two points of a link: their distance by its dimensions and as drawn, and the size of the drawing (m)."""

    link: str
    one: str
    two: str
    own: float
    drawn: float
    size: float

    @property
    def off(self) -> bool:
        """Whether the two distances differ more than in a rough sketch."""
        alike = self.own / OUT_OF_SCALE < self.drawn < self.own * OUT_OF_SCALE
        return not alike and abs(self.drawn - self.own) > ROUGH * self.size


def check_sketch(drawing, sketch: Collection[str]) -> None:
    """Raise `StructureError` where the size of the sketch does not fit the links, or one of them, and where a link is
    sketched mirrored."""
    spans = list(_spans(drawing))
    both = [span for span in spans if span.one in sketch and span.two in sketch]
    some = [span for span in spans if (span.one in sketch) != (span.two in sketch)]
    ranked = sorted(both or some, key=lambda span: span.drawn / span.own)
    if ranked and (middle := ranked[len(ranked) // 2]).off and not _single(drawing, ranked):
        factor = middle.drawn / middle.own
        size = f"{factor:.0f} times as large" if factor > 1 else f"{1 / factor:.0f} times as small"
        where = f"from {middle.one!r} to {middle.two!r} of {middle.link!r}"
        problem = f"does not fit the lengths: {where} it is {size} as the link"
        example = middle.two if middle.two in sketch else middle.one
        remedy = f'write it in the unit of the lengths, e.g. {example} = ["300 mm", "250 mm"]'
        raise StructureError("sketch", problem, remedy)
    wrong = sorted((span for span in (*both, *some) if span.off), key=lambda span: _marked(drawing, span) is not None)
    if wrong:
        raise _misfit(drawing, wrong[0], f"{wrong[0].drawn:.4g} m in the sketch")
    for name in drawing.links:
        _check_sides(drawing, name, sketch)


def allowed(drawing) -> float:
    """The allowed distance (m) of a joint from its sketched place: a thousandth of the size of a drawing that is true
    to scale (one without lengths is), or else a tenth."""
    size = drawing.size()
    off = max((abs(span.own - span.drawn) for span in _spans(drawing)), default=0.0)
    return size * (TRUE if off <= TRUE * size else ROUGH)


def check_reach(drawing, drive: Drive, sketch: Collection[str]) -> None:
    """Raise `StructureError` where the drive puts a pin out of reach of a link that is attached to it."""
    link, slides = drawing.links[drive.link], drawing.guide(drive.link) is not None
    moved = [point for point in link.point_names() if point not in drawing.fixed]
    strange = not slides and _strange(drawing, drive.link) > 0
    for span in _spans(drawing):
        mine, other = (span.one, span.two) if span.one in moved else (span.two, span.one)
        if span.link == drive.link or mine not in moved or mine in sketch or other not in sketch:
            continue
        if span.off and span.drawn > span.own:
            there = f"{mine!r} is {span.drawn:.4g} m from the sketched point {other!r}"
            if slides:
                problem = f"places {drive.link!r} so that {there}, but {span.link!r} spans {span.own:.4g} m"
                raise StructureError("drive", problem, "correct the law of the drive, or the sketch")
            if strange:
                raise _too_long(drawing, drive, f"so that {there}, but {span.link!r} spans {span.own:.4g} m")
            raise _misfit(drawing, span, f"{drive.link!r} is placed so that {there}")
    rest = [at for point, at in drawing.spots.items() if point not in moved]
    within = max((abs(a - b) for a, b in itertools.combinations(rest, 2)), default=0.0)
    extent = max(within, *(float(other.length) for name, other in drawing.links.items() if name != drive.link), 0.0)
    shared = (point for point, ends in drawing.pins().items() if len(ends) > 1 and point in moved)
    for point in shared if strange else ():
        spot = None if point in sketch else drawing.spots.get(point)
        if spot is not None and min(abs(spot - at) for at in rest) > FAR * extent:
            raise _too_long(drawing, drive, f"but the rest of the drawing is only {within:.4g} m across")


def _spans(drawing) -> Iterator[Span]:
    size = drawing.size()
    for name in drawing.links:
        unknown = drawing.unmeasured(name)
        places = {p: at for p, at in drawing.places(name).items() if p in drawing.spots and p not in unknown}
        for one, two in itertools.combinations(places, 2):
            own, drawn = abs(places[two] - places[one]), abs(drawing.spots[two] - drawing.spots[one])
            if own and drawn:
                yield Span(name, one, two, own, drawn, size)


def _single(drawing, spans: list[Span]) -> bool:
    """Whether only one link does not fit, because its size differs from the others."""
    names = {span.link for span in spans}
    return len(names) == 1 and _strange(drawing, *names) != 0


def _strange(drawing, name: str) -> int:
    """Whether a link is much longer (+1) or shorter (-1) than the median of the others, or not (0)."""
    lengths = [float(length) for other, link in drawing.links.items() if other != name
               and (length := number_of(link.length)) is not None and length > 0]  # fmt: skip
    usual, length = statistics.median(lengths) if lengths else 0.0, float(drawing.links[name].length)
    if not (usual > 0 and length > 0):
        return 0
    return (length >= usual * OUT_OF_SCALE) - (length <= usual / OUT_OF_SCALE)


def _misfit(drawing, span: Span, instead: str) -> StructureError:
    """The error for a dimension of a link that disagrees with the drawing."""
    point = _marked(drawing, span)
    between = f"from {span.one!r} to {span.two!r}"
    if point is None:
        remedy = f'write the intended length, e.g. length = "{1000 * span.drawn:.4g} mm", or correct the sketch'
        return StructureError(f"links.{span.link}.length", f"is {span.own:.4g} m {between}, but {instead}", remedy)
    problem = f"makes the distance {between} {span.own:.4g} m, but {instead}"
    return StructureError(f"links.{span.link}.points.{point}", problem, "correct one of the two")


def _marked(drawing, span: Span) -> str | None:
    """The end of the span that is in `points` of the link, and not placed by its length."""
    return next((p for p in (span.two, span.one) if p in drawing.links[span.link].points), None)


def _too_long(drawing, drive: Drive, why: str) -> StructureError:
    """The error for a driven link that reaches far beyond all others."""
    length = float(drawing.links[drive.link].length)
    remedy = f'write the intended unit, e.g. length = "{length:.4g} mm"'
    return StructureError(f"links.{drive.link}.length", f"is {length:.4g} m, {why}", remedy)


def _check_sides(drawing, name: str, sketch: Collection[str]) -> None:
    """Raise `StructureError` where a link is sketched mirrored: three of its points in the opposite sense."""
    places, link, least = drawing.places(name), drawing.links[name], PLAIN * drawing.size()
    known = [p for p in places if p in drawing.spots and p not in drawing.unmeasured(name)]
    for three in itertools.combinations(known, 3):
        one, two, last = sorted(three, key=lambda point: point in sketch)
        own, drawn = (_height(*(at[p] for p in (one, two, last))) for at in (places, drawing.spots))
        if last in sketch and min(abs(own), abs(drawn)) > least and own * drawn < 0:
            base, across = drawing.spots[one], drawing.spots[two] - drawing.spots[one]
            at = base + (places[last] - places[one]) * across / (places[two] - places[one])
            side, line = "left" if drawn > 0 else "right", f"the line from {one!r} to {two!r}"
            problem = f"is to the {side} of {line}, but {name!r} has it on the other side"
            remedy = f"sketch it near ({at.real:.4g}, {at.imag:.4g}) m"
            remedy = f"change the sign of its `across` on the link, or {remedy}" if last in link.points else remedy
            raise StructureError(f"sketch.{last}", problem, remedy)


def _height(a: complex, b: complex, c: complex) -> float:
    """Smallest height of a triangle, positive for counter-clockwise corners."""
    longest = max(abs(b - a), abs(c - a), abs(c - b))
    return ((b - a).conjugate() * (c - a)).imag / longest if longest else 0.0
