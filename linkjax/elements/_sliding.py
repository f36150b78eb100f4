"""Elements with flat faces: slider under a force at an angle, incline, screw, wedge press.

Source: the textbook's chapter on friction, formulas (7-1) and (7-9) to (7-24); the same are found in R. L. Norton,
Design of Machinery, and J. E. Shigley, Mechanical Engineering Design (power screws). φ = arctan f is the angle of
friction.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from linkjax.elements._way import RIGHT, Element, Way, checked, forward, friction_angle, tangent


def slider(angle: Any, friction: Any, load: Any = 1.0) -> Element:
    """A slider pushed by a force P at the `angle` γ (rad) to the normal of its guide, against a `load` Q (N) along it.

    Uniform motion needs P = Q cos φ / sin(γ - φ), efficiency 1 - tan φ / tan γ. It locks, however large the force, for
    γ ≤ φ (7-1). Backward the load moves the slider against P' = Q cos φ / sin(γ + φ), which never locks. `friction` is
    the equivalent coefficient of the guide, see `groove_friction`. Arguments and results are scalars or arrays of one
    shape; raises `ValueError` for an angle that is not between 0 and 90°, a negative coefficient, or a load that is not
    above zero.
    """
    gamma, f, q = checked("the slider", angle=angle, friction=friction, load=load)
    phi = friction_angle(f)
    margin = gamma - phi
    push = q * jnp.cos(phi) / jnp.sin(jnp.where(margin > 0, margin, 1.0))
    onward = forward(push, 1 - f / jnp.tan(gamma), phi, margin)
    held = q * jnp.cos(phi) / jnp.sin(gamma + phi)
    return Element(onward, Way(held, held * jnp.sin(gamma) / q, -phi, gamma + phi), phi)


def incline(angle: Any, friction: Any, load: Any = 1.0) -> Element:
    """A body of weight `load` Q (N) moved up an incline of `angle` α (rad) by a horizontal force.

    Up: P = Q tan(α + φ), η = tan α / tan(α + φ) (7-14, 7-15); it locks for α ≥ 90° - φ. Down: P' = Q tan(α - φ),
    η' = tan(α - φ) / tan α (7-16, 7-17); the body stays where it is for α ≤ φ. Arguments and results are scalars or
    arrays of one shape; raises `ValueError` for an angle that is not between 0 and 90°, a negative coefficient, or a
    load that is not above zero.
    """
    alpha, f, q = checked("the incline", angle=angle, friction=friction, load=load)
    return _inclined(alpha, friction_angle(f), q)


def screw(diameter: Any, lead: Any, friction: Any, load: Any = 1.0, flank: Any = 0.0) -> Element:
    """A screw of mean `diameter` d (m) and `lead` L (m; pitch times starts) against an axial `load` Q (N).

    With tan λ = L / (π d): torque d/2 · Q tan(λ ± φ), η = tan λ / tan(λ + φ) (7-23), and turned by its load η' = tan(λ
    - φ) / tan λ (7-24); it does not turn back for λ ≤ φ. `flank` β (rad) is half the angle of a triangular thread,
    whose angle of friction is arctan(f / cos β); zero for a square thread. `limit` and `margin` are lead angles (rad).
    Arguments and results are scalars or arrays of one shape; raises `ValueError` for a diameter, lead or load that is
    not above zero, a negative coefficient, or a flank angle that is not between 0 and 90°.
    """
    given = {"diameter": diameter, "lead": lead, "friction": friction, "load": load, "flank": flank}
    d, pitch, f, q, beta = checked("the screw", **given)
    return _inclined(jnp.arctan(pitch / (jnp.pi * d)), friction_angle(f / jnp.cos(beta)), q, 0.5 * d)


def wedge_press(angle: Any, friction: Any, load: Any = 1.0) -> Element:
    """A wedge press: a wedge driven by P moves a second wedge against the `load` Q (N), with the `angle` α (rad)
    between the directions of the faces, and the same friction on all three faces.

    P = Q tan(α + 2 φ), η = tan α / tan(α + 2 φ) (7-18, 7-19); it locks for α ≥ 90° - 2 φ (7-20). Released:
    P' = Q tan(α - 2 φ), η' = tan(α - 2 φ) / tan α (7-21); it stays shut for α ≤ 2 φ (7-22). Arguments and results are
    scalars or arrays of one shape; raises `ValueError` for an angle that is not between 0 and 90°, a negative
    coefficient, or a load that is not above zero.
    """
    alpha, f, q = checked("the wedge press", angle=angle, friction=friction, load=load)
    found = _inclined(alpha, 2 * friction_angle(f), q)
    return found._replace(friction_angle=friction_angle(f))


def _inclined(alpha: Any, phi: Any, load: Any, arm: Any = 1.0) -> Element:
    """An incline with the angle of friction φ, and its torque for an `arm` (m)."""
    slope, size = jnp.tan(alpha), load * arm
    up = forward(size * tangent(alpha + phi), slope / jnp.tan(alpha + phi), RIGHT - phi, RIGHT - phi - alpha)
    down = jnp.tan(alpha - phi)
    return Element(up, Way(size * down, down / slope, phi, alpha - phi), phi)
