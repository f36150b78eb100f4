"""The positions of a machine in its JSON document."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkjax.kinematics import Pose
from linkjax.mechanism import Mechanism


def posed(mechanism: Mechanism, here: Pose) -> dict[str, Any]:
    """The keys `points` and `links` of a document. Points are in the order of the mechanism: frame, pins and coupler
    points, then mass centres."""
    centres = [mechanism.links[link].centre_name for link in mechanism.link_names]
    first = [point for point in mechanism.owners() if point not in centres]
    states = {point: here.points[point] for point in [*first, *centres]}
    turned = {link: here.links[link] for link in mechanism.link_names}
    return {
        "points": {
            point: {"x": s.r.x, "y": s.r.y, "dx": s.dr.x, "dy": s.dr.y, "ddx": s.ddr.x, "ddy": s.ddr.y}
            for point, s in states.items()
        },
        "links": {
            link: {"angle": np.unwrap(np.arctan2(s.u.y, s.u.x)), "d": s.w, "dd": s.e} for link, s in turned.items()
        },
    }
