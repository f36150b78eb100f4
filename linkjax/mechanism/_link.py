"""A link: length, coupler points and mass, in its own axes (origin at its first pin, x axis along it)."""

from __future__ import annotations

import dataclasses
from typing import Literal, NamedTuple, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import safe_sqrt
from linkjax._types import as_float, known
from linkjax._vec import Vec

MassProperties = Literal["fixed", "scaled", "section"]


class Counterweight(eqx.Module):
    """A mass fixed to a link: mass (kg) and the position of its centre in the link's axes (m).

    Its own inertia (kg m²) is given as `inertia`, or is that of a disc of `thickness` (m) and `density` (kg/m³),
    m² / (2π thickness density); with neither it is a point mass. An `ideal` counterweight adds the product
    mass · position only: no mass, no inertia; its link must turn about a point of the frame. The position does not
    change with the length of the link. Raises `ValueError` when the inertia is given twice or incompletely.
    """

    mass: Array = eqx.field(converter=as_float, default=0.0)
    at: Vec = eqx.field(default_factory=lambda: Vec(0.0, 0.0))
    inertia: Array | None = eqx.field(converter=as_float, default=None)
    thickness: Array | None = eqx.field(converter=as_float, default=None)
    density: Array | None = eqx.field(converter=as_float, default=None)
    ideal: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        if not isinstance(self.at, Vec) and isinstance(self.at, str | int | float | tuple | list):
            raise TypeError(f"the position of a counterweight must be a Vec, but is {self.at!r}; write Vec(x, y)")
        if (self.thickness is None) != (self.density is None):
            raise ValueError("a disc counterweight needs thickness and density; give both")
        given = [name for name in ("inertia", "thickness") if getattr(self, name) is not None]
        if len(given) > 1 or (given and self.ideal):
            remedy = "an ideal one has no inertia" if self.ideal else "give either inertia, or thickness and density"
            raise ValueError(f"the inertia of a counterweight is already given by {' and '.join(given)}; {remedy}")

    def own_inertia(self) -> Array:
        """Inertia about the centre of the counterweight (kg m²)."""
        if self.inertia is not None:
            return self.inertia
        if self.thickness is None or self.density is None:
            return jnp.zeros_like(self.mass)
        return self.mass**2 / (2 * jnp.pi * self.thickness * self.density)

    def radius(self) -> Array | None:
        """Radius of the disc (m); None if it is not a disc."""
        if self.thickness is None or self.density is None:
            return None
        return safe_sqrt(self.mass / (jnp.pi * self.thickness * self.density))


class Link(eqx.Module):
    """Dimensions and mass of one link (SI units; every number is an array leaf).

    `length` is the distance between its two pins (zero for a slider). `centre` and `points` are given in the link's
    axes; `mass`, `centre` and `inertia` exclude the `counterweights`. `mass_properties` says what happens when the
    length changes: "fixed" keeps mass, centre, inertia and points as given; "scaled" multiplies centre, points and mass
    by l / l_ref and inertia by (l / l_ref)^3, with l_ref = `reference_length`; "section" computes a slender uniform bar
    from `area` and `density`.

    For `linkage`, a link names its `pins`: the first is its origin, the second lies on its x axis at its length (unless
    it is in `points`), further pins are in `points`.
    """

    length: Array = eqx.field(converter=as_float, default=0.0)
    mass: Array = eqx.field(converter=as_float, default=0.0)
    inertia: Array = eqx.field(converter=as_float, default=0.0)
    centre: Vec = eqx.field(default_factory=lambda: Vec(0.0, 0.0))
    points: dict[str, Vec] = eqx.field(converter=lambda points: dict(sorted(points.items())), default_factory=dict)
    counterweights: dict[str, Counterweight] = eqx.field(
        converter=lambda pieces: dict(sorted(pieces.items())), default_factory=dict
    )
    reference_length: Array | None = eqx.field(converter=as_float, default=None)
    area: Array | None = eqx.field(converter=as_float, default=None)
    density: Array | None = eqx.field(converter=as_float, default=None)
    mass_properties: MassProperties = eqx.field(static=True, default="fixed")
    centre_name: str = eqx.field(static=True, default="")
    pins: tuple[str, ...] = eqx.field(converter=tuple, static=True, default=())

    def __check_init__(self):
        if self.mass_properties not in get_args(MassProperties):
            raise ValueError(
                f"mass_properties must be one of {get_args(MassProperties)}, but is {self.mass_properties!r}"
            )
        for name in ("length", "mass", "inertia", "reference_length", "area", "density"):
            value = known(getattr(self, name))
            if value is not None and np.any(value < 0):
                raise ValueError(f"{name} of a link must not be negative, but is {value}; write zero or more")
        for where, at in {"centre": self.centre, **self.points}.items():
            if not isinstance(at, Vec) and isinstance(at, str | int | float | tuple | list):
                raise TypeError(f"{where} of a link must be a Vec, but is {at!r}; write Vec(x, y)")
        if self.mass_properties == "section" and (self.area is None or self.density is None):
            raise ValueError('a link with mass_properties = "section" needs area and density; give both')
        if self.mass_properties == "scaled" and self.reference_length is None:
            raise ValueError('a link with mass_properties = "scaled" needs reference_length; give its original length')

    def point_names(self) -> tuple[str, ...]:
        """Names of its pins and coupler points, without counterweights and mass centre."""
        return tuple(dict.fromkeys((*self.pins, *self.points)))

    def actual(self) -> Body:
        """Mass, mass centre, inertia about it, and points with its own pins, at the present length."""
        body = self._body()
        if not self.pins:
            return body
        none = jnp.zeros_like(self.length)
        ends = dict(zip(self.pins, (Vec(none, none), Vec(self.length, none)), strict=False))
        return dataclasses.replace(body, points={**ends, **body.points})

    def held(self, origin: str, far: str | None) -> Held | None:
        """The line between two of its pins in its axes; None where these are its origin and the end of its length."""
        if far is None or not self.pins or ((origin, far) == self.pins[:2] and far not in self.points):
            return None
        points = self.actual().points
        span = points[far] - points[origin]
        length = safe_sqrt(span.squared(), 1.0)
        return Held(length, points[origin], span / length)

    def _body(self) -> Body:
        if self.mass_properties == "section":
            assert self.area is not None and self.density is not None
            mass = self.area * self.density * self.length
            return Body(mass, Vec(0.5 * self.length, jnp.zeros_like(mass)), mass * self.length**2 / 12, self.points)
        if self.mass_properties == "scaled":
            assert self.reference_length is not None
            k = self.length / jax.lax.stop_gradient(self.reference_length)
            points = {name: at * k for name, at in self.points.items()}
            return Body(self.mass * k, self.centre * k, self.inertia * k**3, points)
        return Body(self.mass, self.centre, self.inertia, self.points)


class Lump(NamedTuple):
    """Mass (kg) at a point and inertia about it (kg m²)."""

    mass: Array
    inertia: Array


def lumps(link: Link, body: Body, origin: str) -> dict[str, Lump]:
    """The masses of a link, by point: the link itself at its mass centre, and its counterweights."""
    found = {link.centre_name: Lump(body.mass, body.inertia)}
    for name, piece in link.counterweights.items():
        if piece.ideal:  # a mass there, its negative at the fixed pivot, no inertia about the pivot
            mass, inertia = found.get(origin, Lump(jnp.zeros_like(piece.mass), jnp.zeros_like(piece.mass)))
            found[origin] = Lump(mass - piece.mass, inertia)
            found[name] = Lump(piece.mass, -piece.mass * piece.at.squared())
        else:
            found[name] = Lump(piece.mass, piece.own_inertia())
    return found


class Held(NamedTuple):
    """The line between two pins of a link: their distance (m), and in the link's axes the position of the first pin and
    the direction to the second."""

    length: Array
    origin: Vec
    axis: Vec


class Body(eqx.Module):
    """Mass (kg), mass centre, central inertia (kg m²) and points of a link at its present length."""

    mass: Array
    centre: Vec
    inertia: Array
    points: dict[str, Vec]


class Flywheel(eqx.Module):
    """Rotating inertia on the crankshaft (kg m²), its centre on the axis."""

    inertia: Array = eqx.field(converter=as_float, default=0.0)
