"""A scissor lift, driven by a cylinder between two of its links."""

from __future__ import annotations

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array

from linkjax._numerics import safe_sqrt, sincos
from linkjax._types import as_float
from linkjax._vec import Vec
from linkjax.groups import AbstractLaw, Drive, General, Guide, Harmonic, Slot
from linkjax.library._parts import Links, Place, check_positive, numbers, origin, parts, vec
from linkjax.mechanism import Link, Mechanism


class ByBar(AbstractLaw):
    """Length (m) of a scissor lift's cylinder when the angle of its bars follows `angle`; the other numbers are
    those of `scissor_lift`."""

    angle: Harmonic
    bar: Array = eqx.field(converter=as_float)
    eye: Array = eqx.field(converter=as_float)
    base: Vec

    def at(self, phi):
        def length(angle):
            return _length(self.bar, self.eye, self.base, angle)

        turned = self.angle.at(phi)
        slope, bend = jax.grad(length)(turned.value), jax.grad(jax.grad(length))(turned.value)
        second = bend * turned.d * turned.d + slope * turned.dd
        return turned._replace(value=length(turned.value), d=slope * turned.d, dd=second)


def scissor_lift(
    bar: ArrayLike, eye: ArrayLike, low: ArrayLike, high: ArrayLike, *,
    base: Place | None = None, pairs: int = 1, by_bar: bool = False, links: Links = None,
) -> Mechanism:  # fmt: skip
    """A scissor lift of two equal bars (m). In one cycle a cylinder raises and lowers it between the bar angles `low`
    and `high` (rad, to the ground).

    The links are `bar` O–T and `other` R–U, hinged to each other at their midpoints C, a `roller` at R on the ground,
    and the cylinder: its `barrel` is pinned at the fixed foot O, or at a point A of the frame at `base` (m); its `rod`
    is pinned at the eye E of the other bar, `eye` (m) above C. O is the origin, R is on the x axis, T and U carry the
    platform. H is the end of the barrel, at half the cylinder's minimum length. The length of the cylinder, pin to pin,
    oscillates between its ends as a cosine; with `by_bar` the angle of the bars does. In both cases the cylinder
    drives, and the drive torque is its force times dlength/dφ. `links` gives masses and points of links, without
    length.

    Lifts have one pair of bars, or two pairs side by side on one cylinder. In the plane these coincide: with `pairs=2`
    the given masses of bars and roller are those of one pair and count twice, loads are those of the whole platform,
    and a joint's reaction is the sum over its pins.

    Raises `ValueError` for lengths that are not positive, an eye beyond the end of the bar, angles that do not increase
    between 0 and 90 degrees, a cylinder that does not extend between them, and `pairs` other than 1 or 2.
    """
    check_positive("scissor_lift", bar=bar, eye=eye)
    if pairs not in (1, 2):
        raise ValueError(f"pairs of a scissor_lift must be 1 or 2, but is {pairs!r}; build others with linkage")
    values = numbers(bar, eye, low, high)
    if values and values[1] > values[0] / 2:
        raise ValueError(
            f"eye of a scissor_lift is {values[1]:g}, but half a bar is {values[0] / 2:g}; give its distance from the "
            "midpoint"
        )
    if values and not 0 < values[2] < values[3] < math.pi / 2:
        raise ValueError(
            f"low and high of a scissor_lift are {values[2]:g} and {values[3]:g} rad; write increasing angles to the "
            "ground between 0 and pi / 2"
        )
    foot, at = ("O", origin()) if base is None else ("A", vec(base))
    bar, eye = as_float(bar), as_float(eye)
    short, long = (_length(bar, eye, at, as_float(angle)) for angle in (low, high))
    spans = numbers(short, long)
    if spans and not 0 < spans[0] < spans[1]:
        raise ValueError(
            f"the cylinder of a scissor_lift is {spans[0]:g} m at low and {spans[1]:g} m at high, but must extend; "
            "move base nearer to the ground or to the fixed foot"
        )
    law = ByBar(Harmonic(low, high), bar, eye, at) if by_bar else Harmonic(short, long)
    middle, axis = Vec(bar / 2, jnp.zeros_like(bar)), _eye(bar, eye, as_float(low)) - at
    lengths = {"bar": bar, "other": bar, "roller": 0.0, "barrel": short / 2, "rod": 0.0}
    marks = {"bar": {"C": middle}, "other": {"C": middle, "E": Vec(bar / 2 + eye, jnp.zeros_like(bar))}}
    sine, cosine = sincos(as_float(low))
    sketch = {
        "T": Vec(bar * cosine, bar * sine), "R": Vec(bar * cosine, jnp.zeros_like(bar)),
        "C": Vec(bar * cosine, bar * sine) * 0.5, "E": at + axis, "H": at + axis * 0.5,
    }  # fmt: skip
    members = (
        ("bar", ("O", "T", "C")), ("other", ("R", "U", "C", "E")), ("roller", ("R",)), ("barrel", (foot, "H")),
        ("rod", ("E",)),
    )  # fmt: skip
    fixed = {"O": origin(), foot: at}
    slots = (Slot("rod", Guide(foot, on="barrel")), Slot("roller", Guide("O")))
    group = General(members, tuple(fixed), sketch, slots, Drive("rod", "barrel", law=law))
    made = parts("scissor_lift", lengths, links, marks)
    for name in ("bar", "other", "roller"):
        made[name] = _times(made[name], pairs)
    return Mechanism(fixed, made, [group])


def _eye(bar, eye, angle) -> Vec:
    """The position of the eye at a bar angle."""
    sine, cosine = sincos(angle)
    return Vec((bar / 2 - eye) * cosine, (bar / 2 + eye) * sine)


def _length(bar, eye, base: Vec, angle) -> Array:
    """Length of the cylinder at a bar angle."""
    return safe_sqrt((_eye(bar, eye, angle) - base).squared())


def _times(link: Link, count: int) -> Link:
    """`count` equal links side by side as one link; a disc counterweight becomes `count` times as thick."""

    def more(given, names):
        return {name: count * getattr(given, name) for name in names if getattr(given, name) is not None}

    pieces = {
        name: dataclasses.replace(piece, **more(piece, ("mass", "inertia", "thickness")))
        for name, piece in link.counterweights.items()
    }
    return dataclasses.replace(link, **more(link, ("mass", "inertia", "area")), counterweights=pieces)
