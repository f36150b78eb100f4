"""The class of a group.

Source: Artobolevsky, Theory of Mechanisms and Machines, 1988, ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkjax.groups._pairs import Pair
from linkjax.groups._rates import bodies

KINDS_OF_II = {"RRR": "II1", "RRP": "II2", "RPR": "II3", "PRP": "II4", "RPP": "II5"}
ROMAN = {3: "III", 4: "IV", 5: "V", 6: "VI", 7: "VII", 8: "VIII", 9: "IX"}


def contours(links: Sequence[str], pairs: Sequence[Pair]) -> int:
    """Class of an Assur group: the number of sides of its largest contour, II for a dyad. A link with three or more
    pairs is a contour with that number of sides; so is a loop of links of the group."""
    sides = [2, *(n for name in links if (n := sum(name in pair.ends for pair in pairs)) > 2)]
    inner = [pair for pair in pairs if set(pair.ends) <= set(links)]
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


def classified(links: Sequence[str], pairs: Sequence[Pair]) -> tuple[str, str]:
    """Class of an Assur group and its pairs as letters.

    Class II is followed by its kind (II1 = RRR, II2 = RRP, II3 = RPR, II4 = PRP, II5 = RPP), a higher class by its
    order, the number of outer pairs (III3 is a triad). The letters of a higher class are those of the outer pairs, then
    of the inner pairs. Links that form a rigid chain, such as three bars pinned to a triangle, count as one link. The
    class of a group with gears in mesh is G.
    """
    links, pairs = _as_bodies(links, pairs)
    inner = [pair for pair in pairs if set(pair.ends) <= set(links)]
    outer = [pair for pair in pairs if pair not in inner]
    if len(links) == 2 and len(pairs) == 3:
        first, last = (next(p.letter for p in outer if name in p.ends) for name in links)
        letters = first + inner[0].letter + last
        letters = letters if letters in KINDS_OF_II else letters[::-1]
        return KINDS_OF_II.get(letters, "II"), letters
    sides = contours(links, pairs)
    ends, within = ("".join(sorted((p.letter for p in some), reverse=True)) for some in (outer, inner))
    if any(pair.letter == "G" for pair in pairs):
        return "G", f"{ends}-{within}"
    return f"{ROMAN.get(sides, 'II' if sides == 2 else str(sides))}{len(outer)}", f"{ends}-{within}"


def _as_bodies(links: Sequence[str], pairs: Sequence[Pair]) -> tuple[Sequence[str], Sequence[Pair]]:
    """The same with one link for each rigid chain of links."""
    inner = [pair for pair in pairs if set(pair.ends) <= set(links)]
    if len(links) < 3 or any(pair.letter == "G" for pair in pairs):
        return links, pairs
    body = bodies(links, inner)
    merged = [p._replace(one=body.get(p.one, p.one), other=body.get(p.other, p.other)) for p in pairs]
    return list(dict.fromkeys(body.values())), [pair for pair in merged if pair.one != pair.other]
