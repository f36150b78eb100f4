"""Springs and dampers as they are drawn: from end to end, with parts of a fixed size on paper."""

import math

import numpy as np
import pytest

import linkjax as lj
from linkjax.viz._ties import WIDE, ties_of

LOADS = (
    lj.Spring("s", "rod", "E", to_point="F", stiffness=1.0),
    lj.Damper("d", "rod", "E", "rocker", to_point="G", coefficient=1.0),
    lj.TorsionSpring("t", "rod", stiffness=1.0, free_angle=0.0),
)
SCENE = lj.Scene(lj.load("hay-press").mechanism, LOADS)


@pytest.mark.parametrize("end", [(3.0, 4.0), (0.0, 0.0)])
def test_lines_lead_from_end_to_end(end):
    unit = 0.01
    for tie, other in zip(ties_of(SCENE), ("F", "G"), strict=True):
        lines = tie.drawn({"E": np.zeros(2), other: np.array(end)}, unit)
        np.testing.assert_allclose(lines[0][0], [0.0, 0.0], atol=1e-15)
        np.testing.assert_allclose(lines[-1][-1], end, atol=1e-15)
        every, size = np.concatenate(lines), math.hypot(*end)
        assert np.all(np.isfinite(every))
        if size:
            across = (every @ np.array([-end[1], end[0]])) / size
            assert np.max(np.abs(across)) == pytest.approx(WIDE * unit)
