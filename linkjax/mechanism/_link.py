"""A link: length, coupler points and mass, in its own axes (origin at its first pin, x axis along it)."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, NamedTuple, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import safe_sqrt
from linkjax._types import as_float, known
from linkjax._vec import Vec
from linkjax.mechanism._uniform import PLATE, bar, plate, plate_fault

MassProperties = Literal["fixed", "scaled", "stretched", "section"]
OF_LENGTH = ("scaled", "stretched")  # these belong to a reference length


class Counterweight(eqx.Module):
    """A mass fixed to a link: mass (kg) and the position of its centre in the link's axes (m).

    Its own inertia (kg m²) is given as `inertia`, or is that of a disc of `thickness` (m) and `density` (kg/m³),
    m² / (2π thickness density); with neither it is a point mass. An `ideal` counterweight adds the product
    mass · position only: no mass, no inertia; its link must turn about a point of the frame. The position does not
    change with the length of the link. Raises `ValueError` when the inertia is given twice or incompletely, and for
    negative numbers.
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
        for name in ("mass", "inertia", "thickness", "density"):
            value = known(getattr(self, name))
            if value is not None and np.any(value < 0):
                raise ValueError(f"{name} of a counterweight must not be negative, but is {value}; write zero or more")
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


def _corners(given: Any) -> bool | tuple[str, ...]:
    """The value of `uniform`: True, False or names of corners. Raises `TypeError` for anything else."""
    if isinstance(given, bool):
        return given
    if not isinstance(given, tuple | list) or not all(isinstance(name, str) for name in given):
        raise TypeError(f"'uniform' of a link is {given!r}; for a bar write True, for a plate {PLATE}")
    return tuple(given)


class Link(eqx.Module):
    """Dimensions and mass of one link (SI units; every number is an array leaf).

    `length` is the distance between its two pins (zero for a slider). `centre` and `points` are given in the link's
    axes; `mass`, `centre` and `inertia` exclude the `counterweights`. `mass_properties` says what happens when the
    length changes: "fixed" keeps mass, centre, inertia and points as given; "scaled" multiplies centre, points and mass
    by l / l_ref and inertia by (l / l_ref)^3, with l_ref = `reference_length`; "stretched" keeps the mass, multiplies
    centre and points by l / l_ref and inertia by (l / l_ref)^2; "section" computes a slender uniform bar from `area`
    and `density`.

    `uniform` computes centre and inertia from `mass` and the present geometry: with True those of a slender uniform bar
    between its (first) two pins, with the names of three or more of its pins and points, in the order of the outline,
    those of a uniform plate with these corners. Raises `ValueError` where they are given, or the mass is zero.

    For `linkage`, a link names its `pins`: the first is its origin, the second lies on its x axis at its length (unless
    it is in `points`), further pins are in `points`.

    Raises `ValueError` for negative or incomplete numbers, and for an unknown `mass_properties`.
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
    uniform: bool | tuple[str, ...] = eqx.field(converter=_corners, static=True, default=False)
    ends: tuple[str, ...] = eqx.field(static=True, default=())  # its pins in its group, set by the mechanism

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
        if self.mass_properties in OF_LENGTH and self.reference_length is None:
            needs = f'a link with mass_properties = "{self.mass_properties}" needs reference_length'
            raise ValueError(f"{needs}; give its original length")
        if self.uniform is not False:
            self._check_uniform()

    def _check_uniform(self) -> None:
        """Raise `ValueError` where the mass of a uniform bar or plate is missing, or given twice."""
        if not isinstance(self.uniform, bool) and len(self.uniform) < 3:
            raise ValueError(f"'uniform' names {len(self.uniform)} corners; {PLATE}, or true for a bar")
        for name in ("area", "density"):
            if getattr(self, name) is not None:
                problem = f"{name!r} of a uniform link has no effect: it has its mass from `mass`"
                raise ValueError(f'{problem}; delete it, or write mass_properties = "section" instead of uniform')
        if self.mass_properties == "section":
            raise ValueError("'uniform' has no effect: mass_properties = \"section\" is a uniform bar; delete it")
        for name, value in (("inertia", self.inertia), ("centre", self.centre.x), ("centre", self.centre.y)):
            number = known(value)
            if number is not None and np.any(number != 0):
                raise ValueError(f"{name!r} of a uniform link is given; delete it, or uniform, which computes it")
        mass = known(self.mass)
        if mass is not None and not np.any(mass):
            raise ValueError("a uniform link without 'mass'; give its mass, or delete uniform")

    def uniform_fault(self) -> tuple[str, str] | None:
        """Problem and remedy where its pins and points form no bar or plate, as `uniform` says; None if they do."""
        pins = self.pins or self.ends
        if self.uniform is True and len(pins) < 2:
            return "a uniform bar has two pins, but this link has one", f"delete uniform, or {PLATE}"
        if isinstance(self.uniform, bool):
            return None
        return plate_fault(self.uniform, {**self._ends(pins), **self._points(self._ratio())})

    def point_names(self) -> tuple[str, ...]:
        """Names of its pins and coupler points, without counterweights and mass centre."""
        return tuple(dict.fromkeys((*self.pins, *self.points)))

    def actual(self) -> Body:
        """Mass, mass centre, inertia about it, and points with its own pins, at the present length. Raises `ValueError`
        for a uniform plate with a corner that is unknown outside of a mechanism."""
        body = self._body()
        return dataclasses.replace(body, points={**self._ends(self.pins), **body.points}) if self.pins else body

    def places(self) -> dict[str, Vec]:
        """Its points, with its own pins, at the present length."""
        return {**self._ends(self.pins), **self._points(self._ratio())}

    def held(self, origin: str, far: str | None) -> Held | None:
        """The line between two of its pins in its axes; None where these are its origin and the end of its length."""
        if far is None or not self.pins or ((origin, far) == self.pins[:2] and far not in self.points):
            return None
        points = self.places()
        span = points[far] - points[origin]
        length = safe_sqrt(span.squared(), 1.0)
        return Held(length, points[origin], span / length)

    def _ends(self, pins: tuple[str, ...]) -> dict[str, Vec]:
        """Positions of its first two pins on its own axis."""
        none = jnp.zeros_like(self.length)
        return dict(zip(pins, (Vec(none, none), Vec(self.length, none)), strict=False))

    def _ratio(self) -> Array | None:
        """Its length relative to that of its mass properties; None where these do not follow it."""
        if self.mass_properties not in OF_LENGTH:
            return None
        assert self.reference_length is not None
        return self.length / jax.lax.stop_gradient(self.reference_length)

    def _points(self, k: Array | None) -> dict[str, Vec]:
        return self.points if k is None else {name: at * k for name, at in self.points.items()}

    def _body(self) -> Body:
        if self.mass_properties == "section":
            assert self.area is not None and self.density is not None
            mass = self.area * self.density * self.length
            return Body(mass, Vec(0.5 * self.length, jnp.zeros_like(mass)), mass * self.length**2 / 12, self.points)
        k, scaled = self._ratio(), self.mass_properties == "scaled"
        points = self._points(k)
        mass = self.mass if k is None or not scaled else self.mass * k
        if self.uniform is not False:
            centre, per_mass = self._even(points)
            return Body(mass, centre, mass * per_mass, points)
        if k is None:
            return Body(mass, self.centre, self.inertia, points)
        return Body(mass, self.centre * k, self.inertia * (k**3 if scaled else k**2), points)

    def _even(self, points: dict[str, Vec]) -> tuple[Vec, Array]:
        """Centre and central inertia per mass of a uniform bar or plate, from its points at the present length."""
        pins = self.pins or self.ends
        places = {**self._ends(pins), **points}
        if self.uniform is True:
            far = places[pins[1]] if len(pins) > 1 else Vec(self.length, jnp.zeros_like(self.length))
            return bar(far)
        assert self.uniform is not False
        unknown = [name for name in self.uniform if name not in places]
        if unknown:
            raise ValueError(f"corner {unknown[0]!r} of a uniform plate has no position; give the link `pins`, "
                             "or put it into a mechanism")  # fmt: skip
        return plate([places[name] for name in self.uniform])


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
