"""A scissor lift, which a cylinder between two of its links drives."""

from __future__ import annotations

import math

import jax.numpy as jnp
from jax.typing import ArrayLike

from linkjax._numerics import safe_sqrt, sincos
from linkjax._types import as_float
from linkjax._vec import Vec
from linkjax.groups import Drive, General, Guide, Harmonic, Slot
from linkjax.library._parts import Links, check_positive, numbers, origin, parts
from linkjax.mechanism import Mechanism


def scissor_lift(
    bar: ArrayLike, eye: ArrayLike, low: ArrayLike, high: ArrayLike, *, links: Links = None
) -> Mechanism:  # fmt: skip
    """A scissor lift of two equal bars (m), which a cylinder raises and lowers between the bar angles `low` and `high`
    (rad, to the ground) in one cycle.

    The links are `bar` O–T and `other` R–U, hinged to each other at their middles C, a `roller` at R on the ground, and
    the cylinder: a `barrel` on the fixed foot O, its `rod` on the eye E of the other bar, `eye` (m) above C. O is the
    origin, R is on the x axis, T and U carry the platform. H is the end of the barrel, at half the cylinder's least
    length. The cylinder's length, pin to pin, goes to and fro between its ends as a cosine (a `Harmonic` law), so the
    drive torque is its force by dlength/dφ. `links` says what else there is to a link, without length.

    Raises `ValueError` for lengths that are none, an eye beyond the end of the bar, and angles that do not rise
    between 0 and 90 degrees.
    """
    check_positive("scissor_lift", bar=bar, eye=eye)
    values = numbers(bar, eye, low, high)
    if values and values[1] > values[0] / 2:
        raise ValueError(
            f"eye of a scissor_lift is {values[1]:g}, but half a bar is {values[0] / 2:g}; give its distance from the "
            "middle"
        )
    if values and not 0 < values[2] < values[3] < math.pi / 2:
        raise ValueError(
            f"low and high of a scissor_lift are {values[2]:g} and {values[3]:g} rad; write angles to the ground that "
            "rise between 0 and pi / 2"
        )
    bar, eye = as_float(bar), as_float(eye)
    at = {"low": _eye(bar, eye, low), "high": _eye(bar, eye, high)}
    short, long = (safe_sqrt(at[end].squared()) for end in ("low", "high"))
    middle = Vec(bar / 2, jnp.zeros_like(bar))
    lengths = {"bar": bar, "other": bar, "roller": 0.0, "barrel": short / 2, "rod": 0.0}
    marks = {"bar": {"C": middle}, "other": {"C": middle, "E": Vec(bar / 2 + eye, jnp.zeros_like(bar))}}
    sine, cosine = sincos(as_float(low))
    sketch = {
        "T": Vec(bar * cosine, bar * sine), "R": Vec(bar * cosine, jnp.zeros_like(bar)),
        "C": Vec(bar * cosine, bar * sine) * 0.5, "E": at["low"], "H": at["low"] * 0.5,
    }  # fmt: skip
    members = (
        ("bar", ("O", "T", "C")), ("other", ("R", "U", "C", "E")), ("roller", ("R",)), ("barrel", ("O", "H")),
        ("rod", ("E",)),
    )  # fmt: skip
    slots = (Slot("rod", Guide("O", on="barrel")), Slot("roller", Guide("O")))
    group = General(members, ("O",), sketch, slots, Drive("rod", "barrel", law=Harmonic(short, long)))
    return Mechanism({"O": origin()}, parts("scissor_lift", lengths, links, marks), [group])


def _eye(bar, eye, angle) -> Vec:
    """Where the eye is at a bar angle."""
    sine, cosine = sincos(as_float(angle))
    return Vec((bar / 2 - eye) * cosine, (bar / 2 + eye) * sine)
