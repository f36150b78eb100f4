"""The class of a group.

Source: Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkjax.groups import FRAME, AbstractGroup
from linkjax.topology._pairs import Pair, pairs_of, parted
from linkjax.topology._rates import bodies

KINDS_OF_II = {"RRR": "II1", "RRP": "II2", "RPR": "II3", "PRP": "II4", "RPP": "II5"}
ROMAN = {3: "III", 4: "IV", 5: "V", 6: "VI", 7: "VII", 8: "VIII", 9: "IX"}


def contours(links: Sequence[str], pairs: Sequence[Pair]) -> int:
    """Class of an Assur group: the number of sides of its largest contour, II for a dyad. A link with three or more
    pairs is a contour with that number of sides; so is a loop of links of the group."""
    sides = [2, *(n for name in links if (n := sum(name in pair.ends for pair in pairs)) > 2)]
    inner = parted(links, pairs)[1]
    for edge in inner:
        reach, length = {edge.one}, 1
        while reach and edge.other not in reach:  # breadth first, without the pair itself
            reach = {b for p in inner if p != edge for a, b in (p.ends, p.ends[::-1]) if a in reach} - {edge.one}
            length += 1
            if length > len(links):
                break
        if edge.other in reach:
            sides.append(length)
    return max(sides)


def class_of(group: AbstractGroup) -> tuple[str, str]:
    """Class and kind of a group, e.g. II1, and its pairs as letters, e.g. RRR. A driver of one link is I1; with other
    links it is I1 and the class of these, as one link while the drive is locked."""
    if group.passive():
        return "passive", group.kind
    names, pairs, one = group.link_names(), pairs_of(group), group.driving()
    if one is None:
        return classified(names, pairs)
    rest = tuple(name for name in names if name != one)
    if not rest:
        return "I1", pairs[0].letter
    on = next((joint.by or FRAME for joint in group.joints() if joint.drives), FRAME)
    held = [p._replace(one=on if p.one == one else p.one, other=on if p.other == one else p.other) for p in pairs]
    found, letters = classified(rest, list(dict.fromkeys(p for p in held if p.one != p.other)))
    return f"I1+{found}", letters


def classified(links: Sequence[str], pairs: Sequence[Pair]) -> tuple[str, str]:
    """Class of an Assur group and its pairs as letters.

    Class II is followed by its kind (II1 = RRR, II2 = RRP, II3 = RPR, II4 = PRP, II5 = RPP), a higher class by its
    order, the number of outer pairs (III3 is a triad). The letters of a higher class are those of the outer pairs, then
    of the inner pairs. Links that form a rigid chain, such as three bars pinned to a triangle, count as one link. The
    class of a group with gears in mesh is G.
    """
    links, pairs = _as_bodies(links, pairs)
    outer, inner = parted(links, pairs)
    if len(links) == 2 and len(pairs) == 3:
        first, last = (next(p.letter for p in outer if name in p.ends) for name in links)
        letters = first + inner[0].letter + last
        letters = letters if letters in KINDS_OF_II else letters[::-1]
        return KINDS_OF_II.get(letters, "II"), letters
    sides = contours(links, pairs)
    ends, within = ("".join(sorted((p.letter for p in some), reverse=True)) for some in (outer, inner))
    if any(pair.letter == "G" for pair in pairs):
        return "G", f"{ends}-{within}" if inner else ends
    return f"{ROMAN.get(sides, 'II' if sides == 2 else str(sides))}{len(outer)}", f"{ends}-{within}"


def _as_bodies(links: Sequence[str], pairs: Sequence[Pair]) -> tuple[Sequence[str], Sequence[Pair]]:
    """The same with one link for each rigid chain of links."""
    inner = parted(links, pairs)[1]
    if len(links) < 3 or any(pair.letter == "G" for pair in pairs):
        return links, pairs
    body = bodies(links, inner)
    merged = [p._replace(one=body.get(p.one, p.one), other=body.get(p.other, p.other)) for p in pairs]
    return list(dict.fromkeys(body.values())), [pair for pair in merged if pair.one != pair.other]
