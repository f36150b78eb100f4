"""What every element has in common: the two directions of its motion, and its checks of input."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._types import as_float, known

RIGHT = math.pi / 2
ANGLES = ("angle", "half_angle")
NOT_NEGATIVE = ("friction", "inner", "pivot", "distance")


class Way(NamedTuple):
    """One direction of motion at uniform speed.

    `effort` is the force (N) or torque (N m) on the driving side: forward the one that overcomes the load, infinite
    where it locks; backward the one that holds the load while it moves back, negative where it locks and has to be
    driven out. `efficiency` is work obtained over work spent, zero or negative where it locks. `limit` is the angle
    (rad) of the element at which it locks, and `margin` how far from it the element is (rad): it locks where that is
    zero or negative.
    """

    effort: Array
    efficiency: Array
    limit: Array
    margin: Array


class Element(NamedTuple):
    """An element that works in two directions: `forward` the effort drives the load, `backward` the load drives the
    element. `friction_angle` is the angle of friction (rad) of its equivalent coefficient."""

    forward: Way
    backward: Way
    friction_angle: Array


def forward(effort: Array, efficiency: Array, limit: Array, margin: Array) -> Way:
    """The way forward; its effort is infinite where the element locks."""
    return Way(jnp.where(margin > 0, effort, jnp.inf), efficiency, limit, margin)


def tangent(angle: Array) -> Array:
    """The tangent of an angle, replaced by a finite number at a right angle and beyond, where no effort suffices."""
    return jnp.tan(jnp.where(angle < RIGHT, angle, 0.25 * math.pi))


def friction_angle(friction: Any) -> Array:
    """The angle of friction (rad) of a coefficient, tan φ = f (7-1)."""
    return jnp.arctan(jnp.asarray(friction, dtype=float))


def checked(element: str, **given: Any) -> list[Any]:
    """The numbers as arrays. Angles must lie between zero and a right angle, coefficients, inner radii and distances
    must not be negative, all others must be above zero; raises `ValueError` otherwise. Traced numbers pass."""
    made = {name: as_float(value) for name, value in given.items()}
    for name, value in made.items():
        if name in ANGLES:
            refuse(element, name, value, lambda x: (x > 0) & (x < RIGHT), "an angle above 0 and below 90 deg (π/2 rad)")
        elif name == "flank":
            refuse(element, name, value, lambda x: (x >= 0) & (x < RIGHT), "an angle from 0 to below 90 deg (π/2 rad)")
        elif name in NOT_NEGATIVE:
            refuse(element, name, value, lambda x: x >= 0, "a finite number of zero or more")
        else:
            refuse(element, name, value, lambda x: x > 0, "a finite number above zero")
    return list(made.values())


def refuse(element: str, name: str, value: Any, good: Callable[[np.ndarray], Any], range_: str) -> None:
    """Raise `ValueError` for a known number that is not good or not finite."""
    number = known(value)
    if number is not None and not np.all(good(number) & np.isfinite(number)):
        unit = " rad" if name in (*ANGLES, "flank") else ""
        raise ValueError(f"{name} of {element} is {np.round(number, 6)}{unit}; write {range_}")
