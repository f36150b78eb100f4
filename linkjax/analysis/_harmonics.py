"""Harmonics of torque and speed over the crank angle."""

from __future__ import annotations

from linkjax.analysis._cycle import Cycle
from linkjax.machine import ReadyScene, Scene
from linkjax.measures import Harmonics, Parts, harmonic_family, harmonics_of

MOST = 1000  # the highest order that is computed


def harmonics(
    of: Cycle | Scene | ReadyScene, what: str = "drive_torque", orders: int = 12, nodes: int = 96
) -> Harmonics:
    """The Fourier series of a quantity over the crank angle, by order of the crank's revolution.

    `of` is a scene or its analysed cycle, `what` a quantity of `docs/measures.md` that is a number with its sign:
    "drive_torque", "motor_torque", "crank_speed", "x.D", with `_constant_speed` before the dot at constant nominal
    speed. The orders are 1 to `orders`; in a cycle of several turns also those between, by the reciprocal of the turns.
    Mean and root mean square are over the crank angle. Jumps of loads are integrated panel by panel. `nodes` is the
    number of nodes of the cycle grid per crank turn: orders up to about half of it are meaningful.

    Pure and differentiable; a phase has no derivative where its amplitude vanishes. Where no steady-state motion exists
    the values of an actual motion are finite but meaningless, as those of measures. Raises `StructureError` for a
    vector, and anything that is not such a quantity of the scene; ValueError unless `orders` is from 1 to 1000.
    """
    if isinstance(orders, bool) or not isinstance(orders, int) or not 1 <= orders <= MOST:
        raise ValueError(f"orders must be an integer from 1 to {MOST}, but is {orders!r}; write e.g. 12")
    given = of.scene if isinstance(of, Cycle) else of
    scene = given.scene if isinstance(given, ReadyScene) else given
    asked = harmonic_family(what, scene)
    return harmonics_of(Parts(given, nodes), [asked], orders)[0]


def asked_harmonics(cycle: Cycle, orders: int, nodes: int = 96) -> dict[str, Harmonics]:
    """The harmonics of drive torque, of motor torque if there is a motor, and of the crank speed: in the actual motion
    of a cycle, or without one those of the torques at constant speed."""
    moves, scene = cycle.steady is not None, cycle.scene
    names = [f"{name}{'' if moves else '_constant_speed'}" for name in
             ("drive_torque", *(("motor_torque",) if scene.motor is not None else ()))]  # fmt: skip
    names += ["crank_speed"] if moves and not scene.mechanism.prescribed else []
    asked = [harmonic_family(name, scene) for name in names]
    return dict(zip(names, harmonics_of(Parts(scene, nodes), asked, orders), strict=True))
