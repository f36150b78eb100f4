"""Every plane kinematic chain of one degree of freedom with simple revolute joints, up to isomorphism.

A chain is a graph: links are vertices, joints edges. No part of the `n` links and their joints may be rigid.
Known counts: 1, 2 and 16 chains with 4, 6 and 8 links, e.g. Crossley, A contribution to Gruebler's theory in the number
synthesis of plane mechanisms, J. Eng. Ind. 86 (1964).
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterable, Sequence

from linkjax.groups import FRAME
from linkjax.topology import Pair

Edge = tuple[int, int]
Chain = tuple[Edge, ...]


def _colours(count: int, edges: Sequence[Edge], marks: Sequence[int]) -> list[int]:
    """Colours of vertices, refined by those of their neighbours."""
    beside: list[list[int]] = [[] for _ in range(count)]
    for a, b in edges:
        beside[a].append(b)
        beside[b].append(a)
    colours = list(marks)
    for _ in range(3):
        colours = [hash((colours[v], tuple(sorted(colours[w] for w in beside[v])))) for v in range(count)]
    return colours


def canonical(count: int, edges: Iterable[Edge], marks: Sequence[int] = ()) -> tuple[Chain, tuple[int, ...]]:
    """The same edges and marks for all numberings of a graph whose vertices carry marks."""
    edges = list(edges)
    marks = tuple(marks) or (0,) * count
    colours = _colours(count, edges, marks)
    classes = [[v for v in range(count) if colours[v] == c] for c in sorted(set(colours))]
    found = []
    for orders in itertools.product(*(itertools.permutations(each) for each in classes)):
        number = {v: i for i, v in enumerate(itertools.chain(*orders))}
        found.append(tuple(sorted((min(number[a], number[b]), max(number[a], number[b])) for a, b in edges)))
    return min(found), tuple(marks[v] for each in classes for v in each)


def _stays_loose(count: int, edges: Sequence[Edge], new: Edge) -> bool:
    """Whether no part of the links is rigid with the new joint."""
    others = [v for v in range(count) if v not in new]
    for size in range(count - 1):
        for more in itertools.combinations(others, size):
            part = {*new, *more}
            if 2 * sum(a in part and b in part for a, b in edges) > 3 * len(part) - 4:
                return False
    return True


@functools.cache
def chains(count: int) -> tuple[Chain, ...]:
    """All chains with this number of links."""
    level: set[Chain] = {()}
    for _ in range((3 * count - 4) // 2):
        grown = set()
        for edges in level:
            for new in itertools.combinations(range(count), 2):
                more = (*edges, new)
                if new not in edges and _stays_loose(count, more, new):
                    grown.add(canonical(count, more)[0])
        level = grown
    return tuple(sorted(level))


def driven_chains(count: int, at_ground: bool) -> list[tuple[Chain, int, Edge]]:
    """Every chain with every ground and every driving joint (of the ground's, or any), once each."""
    found = {}
    for chain in chains(count):
        for ground in range(count):
            for edge in chain:
                if at_ground and ground not in edge:
                    continue
                marks = [1 if v == ground else 0 for v in range(count)] + [2]
                middle = [(edge[0], count), (count, edge[1])]
                rest = [e for e in chain if e != edge]
                key = (chain, canonical(count + 1, [*rest, *middle], marks))
                found.setdefault(key, (chain, ground, edge))
    return list(found.values())


def grounded(count: int) -> int:
    """Number of chains with a ground."""
    return len({(chain, canonical(count, chain, [int(v == ground) for v in range(count)]))
                for chain in chains(count) for ground in range(count)})  # fmt: skip


@functools.cache
def sliding(count: int) -> list[tuple]:
    """Every chain of so many links with its ground, its driving joint at ground, and a joint that is a slider."""
    return [(*one, other) for one in driven_chains(count, at_ground=True) for other in one[0] if other != one[2]]


def named(chain, ground, letters=None) -> list[Pair]:
    """The pairs of a chain; links are named by their numbers, the ground is the frame."""
    names = [FRAME if v == ground else f"k{v}" for v in range(1 + max(itertools.chain(*chain)))]
    letters = letters or {}
    pairs = []
    for a, b in chain:
        a, b = (b, a) if a == ground else (a, b)
        pairs.append(
            Pair(letters.get((a, b), letters.get((b, a), "R")), f"j{min(a, b)}{max(a, b)}", names[a], names[b])
        )
    return pairs


def links_of(chain, ground) -> list[str]:
    return [f"k{v}" for v in range(1 + max(itertools.chain(*chain))) if v != ground]
