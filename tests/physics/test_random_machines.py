"""Thousands of random machines: each group alone, and compositions of up to eight groups, by independent methods.

None is omitted: a machine that can be assembled at its crank angle is checked there, also near a singular position;
groups closed by Newton's method where they can be followed from their sketch, and six degrees further at either end.
"""

from __future__ import annotations

import dataclasses
import zlib
from collections import defaultdict
from typing import NamedTuple

import jax
import numpy as np
import pytest

from linkjax import RRR
from tests.physics.judged import CLOSURE, SUMMED, Verdict, histogram, judged
from tests.physics.random_general import DRIVERS, LOOPS
from tests.physics.random_machines import KINDS, composed, drawn

DESIGNS, FEW = 36, 12


class Case(NamedTuple):
    """A composition: its number, how many groups or which, its driver; given by links and joints or by groups."""

    plan: int
    groups: int
    kinds: tuple[str, ...] = ()
    driver: str = ""
    drawn: bool = False

    def batch(self, designs: int):
        made = composed(self.plan, self.groups, designs, self.kinds, self.driver)
        return drawn(made, self.plan) if self.drawn else made


ALONE = [Case(1000 + 10 * i + j, 1, (kind,), driver)
         for i, kind in enumerate(KINDS) for j, driver in enumerate(("turns", "swings", "slides"))]  # fmt: skip
TOGETHER = [
    Case(plan, 2 + plan % 7, driver="turns" if plan % 3 == 0 else "", drawn=plan % 3 == 0) for plan in range(42)
]
IN_GEAR = [
    Case(2000 + i, len(kinds), kinds, driver)
    for i, (kinds, driver) in enumerate([
        (("gear",), "turns"), (("planet",), "turns"), (("belt",), "turns"), (("gear",), "swings"),
        (("gear", "RRR"), "turns"), (("planet", "RRP", "RPR"), "turns"), (("belt", "RRR", "PRP"), "swings"),
        (("gear", "rack", "pinion"), "swings"), (("gear", "rack", "RRR", "RPP"), "swings"),
        (("planet", "gear", "RRR", "RRP", "RPR", "PRP", "RPP", "RRR"), "turns"),
    ])
]  # fmt: skip
IN_LOOPS = [
    Case(3000 + i, len(kinds), kinds, driver)
    for i, (driver, *kinds) in enumerate([
        *(("turns", kind) for kind in LOOPS), *(("swings", kind) for kind in LOOPS[:2]),
        *((driver, "RRR") for driver in DRIVERS), ("slides", "tetrad", "RRR"), ("cylinder", "triad", "RPR"),
        ("inside", "dyad", "RRP"), ("turns", "RRR", "triad", "RRP"),
        ("turns", "RPP", "two plates", "RRR"), ("swings", "triad with a slot", "tetrad"),
        ("turns", "RRR", "RRP", "triad", "RPR", "dyad with a slot", "PRP", "RPP", "RRR"),
    ]) for kinds in [tuple(kinds)]
]  # fmt: skip
QUICK = [TOGETHER[0]]


@pytest.fixture(scope="module")
def verdicts(tell):
    """Collects the results by subject, and prints their ratio to the tolerance."""
    found: defaultdict[str, list[Verdict]] = defaultdict(list)
    yield found
    for about, each in found.items():
        tell(f"{about}: {(lines := histogram(each))[0]}", *lines[1:])


def check(case: Case, designs: int, verdicts: list[Verdict], **options):
    rng = np.random.default_rng(zlib.crc32(repr(case).encode()))
    batch = case.batch(designs)
    verdict = judged(batch, rng, **options)
    verdicts.append(verdict)
    for (kind, road), over in verdict.over.items():
        assert np.all(over <= 1.0), (
            f"{batch.name}: {kind} of design {np.argmax(over)}, by {road}, is off by {np.max(over):.2g} times"
        )


@pytest.mark.parametrize("case", QUICK, ids=str)
def test_some(case, verdicts):
    check(case, FEW, verdicts["some random machines"], exact=4, slopes=2)


@pytest.mark.slow
def test_some_in_a_loop(verdicts):
    case = IN_LOOPS[LOOPS.index("dyad with a slot")]
    check(case, 4, verdicts["some random machines"], compiled=True, exact=2, slopes=0)


@pytest.mark.slow
@pytest.mark.parametrize("case", [*ALONE, *TOGETHER, *IN_GEAR, *IN_LOOPS], ids=str)
def test_all(case, verdicts):
    check(case, DESIGNS, verdicts["random machines"])


@pytest.mark.slow
@pytest.mark.parametrize("case", [*ALONE[::3], TOGETHER[0], *IN_LOOPS[:2]], ids=str)
def test_compiled(case, verdicts):
    check(case, DESIGNS, verdicts["some of them, compiled"], compiled=True, exact=4, slopes=4)


@pytest.mark.slow
def test_what_is_wrong_is_seen(monkeypatch):
    """A link of the group two parts in 10^12 too long in the solution of linkjax."""

    def solve(self, links, states, points, phi, true=RRR.solve):
        longer = dataclasses.replace(links["a1"], length=links["a1"].length * (1 + 2e-12))
        return true(self, {**links, "a1": longer}, states, points, phi)

    monkeypatch.setattr(RRR, "solve", solve)
    over = judged(ALONE[0].batch(FEW), np.random.default_rng(0), exact=3, slopes=2).over
    seen = ("position", "velocity", "acceleration", "turning", "drive", "force", "gradient", "gradient with reactions")
    assert all(np.max(over[kind, "mpmath"]) > 1.0 for kind in seen)
    assert np.max(over[CLOSURE]) > 1.0 and np.max(over["force", "NumPy"]) > 1.0


@pytest.mark.slow
def test_a_wrong_slope_of_a_reaction_is_seen(monkeypatch):
    """Correct forces of the group with wrong slopes: forward and reverse mode agree on them."""

    def react(self, loads, states, points, true=RRR.react):
        x = points[self.meet].r.x
        forces, extra = true(self, loads, states, points)
        return jax.tree.map(lambda part: part * (1.0 + 1e-10 * (x - jax.lax.stop_gradient(x))), forces), extra

    monkeypatch.setattr(RRR, "react", react)
    over = judged(ALONE[0].batch(FEW), np.random.default_rng(0), exact=3, slopes=2).over
    wrong = {key for key, each in over.items() if np.any(each > 1.0)}
    assert ("gradient with reactions", "mpmath") in wrong and wrong <= {(kind, "mpmath") for kind in SUMMED}


def test_there_are_as_many_as_promised():
    assert (len(ALONE) + len(TOGETHER) + len(IN_GEAR)) * DESIGNS >= 2400
    assert len(IN_LOOPS) * DESIGNS >= 600
    assert {case.groups for case in (*ALONE, *TOGETHER)} == set(range(1, 9))
