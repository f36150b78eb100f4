"""The same machines twice: every group in closed form, and every group by Newton's method as links and joints.

Random compositions, like those of `test_random_machines.py`, at crank angles up to a radian from their sketch; all
groups can be assembled all the way, and six degrees further at either end, as required for following them (singular
positions are in `test_near_dead.py`). The two must agree to 1e-12 of the size of the compared quantity, and 1e-14
times its condition number, as in `judged.py`; gradients by the norm of every slope times its number.
"""

from __future__ import annotations

import zlib

import numpy as np
import pytest

from tests.physics.twins import Case, apart

QUICK = Case(0, 1, designs=24)
CASES = [Case(1, 2), Case(8, 3), Case(7, 3, "slides"), Case(7, 4), Case(2, 5), Case(1, 6)]  # by their number, as many
# groups; for other numbers a search may find no dimensions with which a group can be assembled all the way


@pytest.fixture(scope="module")
def furthest():
    """Collects the differences of twins, and prints the largest (seen with `pytest -s`)."""
    found: list[dict[str, np.ndarray]] = []
    yield found
    if found:
        worst = {kind: max(float(np.max(over[kind])) for over in found) for kind in found[0]}
        lines = ", ".join(f"{kind} {most:.2g}" for kind, most in worst.items())
        print(f"\n{sum(len(over['position']) for over in found)} twins, apart over what is allowed: {lines}")


def check(case: Case, furthest, **options):
    batch = case.batch()
    over = apart(batch, np.random.default_rng(zlib.crc32(repr(case).encode())), **options)
    furthest.append(over)
    for kind, off in over.items():
        assert np.all(off <= 1.0), f"{batch.name}: {kind} of design {np.argmax(off)} is off by {np.max(off):.2g} times"


@pytest.mark.slow
def test_a_dyad(furthest):
    check(QUICK, furthest, compiled=True)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=str)
def test_compositions(case, furthest):
    check(case, furthest)
