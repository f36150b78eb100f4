"""A link: length, marked points and mass, in its own frame (origin at its first pin, x axis along it)."""

from __future__ import annotations

from typing import Literal, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._types import as_float
from linkjax._vec import Vec

MassProperties = Literal["fixed", "scaled", "section"]


class Link(eqx.Module):
    """What the designer chose for one link (SI units; every number is an array leaf).

    `length` is the distance between its two pins (zero for a sliding block). `centre` and `points` are given in the
    link's frame. `mass_properties` says what happens when the length changes: "fixed" keeps mass, centre, inertia
    and points as given; "scaled" lets centre and points follow l / l_ref, mass l / l_ref and inertia (l / l_ref)^3
    from `reference_length`; "section" computes a slender uniform bar from `area` and `density`.
    """

    length: Array = eqx.field(converter=as_float, default=0.0)
    mass: Array = eqx.field(converter=as_float, default=0.0)
    inertia: Array = eqx.field(converter=as_float, default=0.0)
    centre: Vec = eqx.field(default_factory=lambda: Vec(0.0, 0.0))
    points: dict[str, Vec] = eqx.field(converter=lambda points: dict(sorted(points.items())), default_factory=dict)
    reference_length: Array | None = eqx.field(converter=as_float, default=None)
    area: Array | None = eqx.field(converter=as_float, default=None)
    density: Array | None = eqx.field(converter=as_float, default=None)
    mass_properties: MassProperties = eqx.field(static=True, default="fixed")
    centre_name: str = eqx.field(static=True, default="")

    def __check_init__(self):
        if self.mass_properties not in get_args(MassProperties):
            raise ValueError(
                f"mass_properties must be one of {get_args(MassProperties)}, but is {self.mass_properties!r}"
            )
        for where, at in {"centre": self.centre, **self.points}.items():
            if not isinstance(at, Vec) and isinstance(at, str | int | float | tuple | list):
                raise TypeError(f"{where} of a link must be a Vec, but is {at!r}; write Vec(x, y)")
        if self.mass_properties == "section" and (self.area is None or self.density is None):
            raise ValueError('a link with mass_properties = "section" needs area and density; give both')
        if self.mass_properties == "scaled" and self.reference_length is None:
            raise ValueError('a link with mass_properties = "scaled" needs reference_length; give its length as drawn')

    def actual(self) -> Body:
        """Mass, mass centre, inertia about it and marked points at the present length."""
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


class Body(eqx.Module):
    """Mass (kg), mass centre, central inertia (kg m²) and marked points of a link at its present length."""

    mass: Array
    centre: Vec
    inertia: Array
    points: dict[str, Vec]


class Flywheel(eqx.Module):
    """Rotating inertia on the crank shaft (kg m²), its centre on the axis."""

    inertia: Array = eqx.field(converter=as_float, default=0.0)
