"""Dimensions of a flywheel for a wanted moment of inertia: a disc, or a rim on light spokes."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import as_float
from linkjax.drives._motors import check_numbers


class Disc(NamedTuple):
    """A solid disc: mass (kg), diameter and width (m)."""

    mass: Array
    diameter: Array
    width: Array


class Rim(NamedTuple):
    """A rim of rectangular section: mass (kg), mean diameter, width along the axis and height along the radius (m)."""

    mass: Array
    diameter: Array
    width: Array
    height: Array


def disc_flywheel(inertia: Any, density: Any, diameter: Any = None, width: Any = None) -> Disc:
    """The disc with a moment of `inertia` (kg m²) about its axis, of a material of this `density` (kg/m³), with a given
    `diameter` or `width` (m): J = m D² / 8, m = density · π D² / 4 · width.

    Raises `ValueError` unless exactly one of the two is given, and for a number that is not above zero.
    """
    given = {"inertia": inertia, "density": density, "diameter": diameter, "width": width}
    j, rho, d, b = _numbers("a disc flywheel", given)
    _one("disc", {"diameter": d, "width": b})
    if d is None:
        d = (32 * j / (jnp.pi * rho * b)) ** 0.25
    mass = 8 * j / d**2
    return Disc(mass, d, mass / (rho * jnp.pi * d**2 / 4) if b is None else b)


def rim_flywheel(
    inertia: Any, density: Any, diameter: Any, width: Any = None, height: Any = None, shape: Any = None
) -> Rim:
    """The rim with a moment of `inertia` (kg m²) about its axis, of a material of this `density` (kg/m³) and the mean
    `diameter` (m): J = m D² / 4, m = density · π D · width · height. One more dimension is given: the `width` along the
    axis, the `height` along the radius (m), or the `shape`, height over width.

    Spokes and hub do not count. A rim of this section has exactly m (D² + height²) / 4, so that the formula is on the
    safe side. Course designs take a mean diameter of two to three crank lengths for a flywheel inside the machine.
    Raises `ValueError` unless exactly one of the three is given, and for a number that is not above zero.
    Source: I. I. Artobolevsky, Theory of Mechanisms and Machines, ch. 19 (flywheels).
    """
    given = {"inertia": inertia, "density": density, "diameter": diameter,
             "width": width, "height": height, "shape": shape}  # fmt: skip
    j, rho, d, b, h, s = _numbers("a rim flywheel", given)
    _one("rim", {"width": b, "height": h, "shape": s})
    mass = 4 * j / d**2
    section = mass / (rho * jnp.pi * d)
    if s is not None:
        b = jnp.sqrt(section / s)
    if b is None:
        return Rim(mass, d, section / h, h)
    return Rim(mass, d, b, section / b)


def _numbers(kind: str, given: dict[str, Any]) -> list[Any]:
    """The numbers as arrays; raises `ValueError` for one that is not above zero."""
    made = {name: as_float(value) for name, value in given.items()}
    check_numbers(kind, made)
    return list(made.values())


def _one(kind: str, given: dict[str, Any]) -> None:
    """Raise `ValueError` unless exactly one dimension is given."""
    if sum(value is not None for value in given.values()) != 1:
        raise ValueError(f"a {kind} flywheel needs one of {', '.join(given)}; give exactly one")
