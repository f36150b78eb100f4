"""Reference cases R1-R3: the printed table of the prototype, its closure, and the eccentric chains derived from it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from linkjax.rolling import Rolling, chain, closing_outer_radius, closure_gap
from tests.helpers import ROOT

GOLDEN = json.loads((ROOT / "tests/data/golden.json").read_text(encoding="utf-8"))
TABLE = json.loads((ROOT / "tests/data/printed.json").read_text(encoding="utf-8"))["rolling"]
ECCENTRIC = ("rolling.emk_e0", "rolling.emk_e2", "rolling.emk_e5", "rolling.emk_e10")


def closed(inner: float, bodies: int, e: float = 0.0) -> Rolling:
    return Rolling(inner, closing_outer_radius(inner, bodies, e), bodies, eccentricity=e)


@pytest.mark.parametrize(("points", "of"), [("centres", "centres"), ("inner", "inner_contacts"),
                                            ("outer", "outer_contacts")])  # fmt: skip
def test_the_printed_table(points, of):
    """R1; the table covers half of the symmetric scheme."""
    at = getattr(chain(closed(TABLE["inner_radius"], TABLE["bodies"])), of)
    ours = np.stack([at.x, at.y], axis=1)[: len(TABLE[points])]
    off = np.abs(ours - np.array(TABLE[points])).max(axis=1)
    wrong = set(TABLE["untrusted"].get(points, ()))
    assert {i for i, each in enumerate(off) if each > TABLE["tolerance"]} == wrong
    for i in wrong:  # misprinted in the angle only
        assert np.hypot(*TABLE[points][i]) == pytest.approx(TABLE["outer_radius"], abs=TABLE["tolerance"])


def test_the_prototype():
    """R2."""
    want = GOLDEN["rolling.prototype"]
    design = closed(want["Rv"], want["z"])
    assert float(design.outer_radius) == pytest.approx(want["Rn"], abs=1e-8)
    np.testing.assert_allclose(chain(design).radii, want["r"], rtol=0, atol=1e-8)
    assert want["r"] == pytest.approx(TABLE["body_radius"], abs=TABLE["tolerance"])


@pytest.mark.parametrize("name", ECCENTRIC)
def test_eccentric_chains(name):
    """R3."""
    want = GOLDEN[name]
    design = closed(want["Rv"], want["z"], want["e"])
    made = chain(design)
    assert float(design.outer_radius) == pytest.approx(want["Rn"], abs=1e-9)
    np.testing.assert_allclose(made.angles, np.radians(want["phi_deg"]), rtol=0, atol=1e-12)
    np.testing.assert_allclose(made.radii, want["ball_r"], rtol=0, atol=1e-9)
    assert abs(float(closure_gap(design))) < 1e-12
