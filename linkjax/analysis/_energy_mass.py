"""The energy-mass diagram of Wittenbauer: change of kinetic energy over reduced inertia.

The kinetic energy is E = ½ J ω², so a point of the curve seen from the place of zero energy and zero inertia has the
slope ω²/2. The tangents from there to the curve have the slopes of the largest and the smallest speed.
Source: F. Wittenbauer, Graphische Dynamik, Springer 1923; Artobolevsky, Theory of Mechanisms and Machines, 1988,
ch. 16.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from linkjax.analysis._document import moves
from linkjax.machine import Scene


class EnergyMass(NamedTuple):
    """The diagram: reduced `inertia` with the rotor (kg m²) and change of kinetic `energy` since crank angle zero (J)
    at the crank angles of the document; the energy at the `origin` of the tangents (J), where the inertia is zero and
    all kinetic energy is gone; the slopes ω²/2 (rad²/s²) of the tangents for the largest and smallest speed, and the
    points (inertia, energy) at which they touch the curve, between the crank angles of the document by a straight line.
    """

    inertia: np.ndarray
    energy: np.ndarray
    origin: float
    max_slope: float
    min_slope: float
    max_point: tuple[float, float]
    min_point: tuple[float, float]


def energy_mass(data: dict[str, Any], scene: Scene) -> EnergyMass:
    """The diagram of an analysis, from its document and its scene. Raises `ValueError` where it has no actual motion,
    and where a motion law prescribes the speed."""
    if not moves(data) or scene.mechanism.prescribed:
        raise ValueError("the energy-mass diagram is one of an actual motion, which this analysis does not have; "
                         "analyse a scene with masses, without a motion law and constant_speed")  # fmt: skip
    motion = data["motion"]
    rotor = 0.0 if scene.motor is None else float(scene.motor.rotor_inertia())
    inertia = np.asarray(data["reduced"]["inertia"], float) + rotor
    kinetic = 0.5 * inertia * np.asarray(motion["speed"], float) ** 2
    most, least = (0.5 * float(motion[f"{end}_speed"]) ** 2 for end in ("max", "min"))
    start = float(np.interp(0.0, data["angles"], kinetic, period=scene.cycle))
    energy = kinetic - start
    points = [_touching(data, scene, inertia, float(motion[f"angle_of_{end}"])) for end in ("max", "min")]
    touch = [(x, slope * x - start) for x, slope in zip(points, (most, least), strict=True)]
    return EnergyMass(inertia, energy, -start, most, least, *touch)


def _touching(data: dict[str, Any], scene: Scene, inertia: np.ndarray, angle: float) -> float:
    """The reduced inertia (kg m²) at a crank angle (rad), from the values at the angles of the document."""
    return float(np.interp(angle, np.asarray(data["angles"], float), inertia, period=scene.cycle))
