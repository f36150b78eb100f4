"""Friction of pins, guides and meshes: its size, from the force that the joint transmits.

Source: the textbook's chapter on friction, formulas (7-2) to (7-8); Artobolevsky, Theory of Mechanisms and Machines,
1988, ch. 11. Friction is that of motion: it acts against the relative motion of the two links, with a size that follows
from the actual reaction.
"""

from __future__ import annotations

import abc
import dataclasses
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import safe_sqrt
from linkjax._types import Tracer, as_float, known
from linkjax._units import nearest
from linkjax.elements import groove_friction, journal_friction, seat_friction, thrust_ring
from linkjax.friction._indeterminate import indeterminate
from linkjax.groups import Joint
from linkjax.mechanism import Mechanism, StructureError


class AbstractFriction(eqx.Module):
    """Friction of one joint, whose `size` is a couple (N m) in a pin or on a gear, and a force (N) in a guide or on a
    rack."""

    @property
    @abc.abstractmethod
    def joint(self) -> str:
        """Name of the joint."""

    @abc.abstractmethod
    def size(self, fx: Array, fy: Array, moment: Array) -> Array:
        """Size of the friction for a force (N) and moment (N m) that the joint transmits without it; in a mesh, `fx` is
        what drives the gear (N m) or the rack (N) along its motion, negative where it drives the other one."""

    def switches(self, normal: Array, moment: Array) -> tuple[Array, ...]:
        """Numbers at whose zeros the size has a kink, from the force (N) and moment (N m) that a guide transmits across
        its direction, or from what drives a gear or rack; as many as `kinks`."""
        return ()

    @property
    def kinks(self) -> int:
        """How many these numbers are."""
        return 0

    def at_rest(self) -> AbstractFriction:
        """The friction of a machine at rest: the greatest before it starts to move."""
        return self


class Thrust(eqx.Module):
    """A thrust face between the radii `inner` and `outer` (m) under a given axial `force` (N); see
    `elements.thrust_ring`."""

    force: Array = eqx.field(converter=as_float)
    outer: Array = eqx.field(converter=as_float)
    coefficient: Array = eqx.field(converter=as_float)
    inner: Array = eqx.field(converter=as_float, default=0.0)
    bearing: Literal["unworn", "run-in"] = eqx.field(static=True, default="unworn")

    def __check_init__(self):
        self.couple()

    def couple(self) -> Array:
        """Its friction couple (N m)."""
        return thrust_ring(self.outer, self.coefficient, self.force, self.inner, bearing=self.bearing).torque


class PinFriction(AbstractFriction):
    """Friction of a pin at a `point`: the couple f₀ r |R| of a journal of the `radius` r (m) that transmits the force
    R.

    f₀ follows from the `coefficient` and the `bearing`, see `elements.journal_friction`. A rolling bearing has its
    coefficient and half of its mean diameter as radius. A `thrust` face adds a constant couple. The coefficient of
    `static` friction, for starting, is by default the same. Raises `ValueError` for a negative coefficient or radius,
    and for an unknown bearing.
    """

    point: str = eqx.field(static=True)
    coefficient: Array = eqx.field(converter=as_float)
    radius: Array = eqx.field(converter=as_float)
    bearing: Literal["given", "unworn", "run-in"] = eqx.field(static=True, default="given")
    thrust: Thrust | None = None
    static: Array | None = eqx.field(converter=as_float, default=None)

    def __check_init__(self):
        _not_negative(f"the pin {self.point!r}", "static", self.static)
        journal_friction(self.coefficient, self.bearing)
        _not_negative(f"the pin {self.point!r}", "coefficient", self.coefficient)
        _not_negative(f"the pin {self.point!r}", "radius", self.radius)

    @property
    def joint(self):
        return self.point

    def size(self, fx, fy, moment):
        couple = journal_friction(self.coefficient, self.bearing) * self.radius * safe_sqrt(fx * fx + fy * fy)
        return couple if self.thrust is None else couple + self.thrust.couple()

    def at_rest(self):
        return self if self.static is None else dataclasses.replace(self, coefficient=self.static, static=None)


class GuideFriction(AbstractFriction):
    """Friction of the block or link `link` in its guide: f₀ times the normal force N.

    f₀ is the `coefficient` f, in a wedge-shaped groove of half angle `groove` θ (rad) f / sin θ, and with a curved seat
    of the factor `seat` k it is k f. With the `length` L (m) of a guide that encloses the block, the couple M of the
    guide is carried by its edges, and the force that rubs is max(|N|, 2 |M| / L): where the couple tilts the block,
    both sides are loaded. Without a length the couple is assumed to be carried by one face, whose friction depends on N
    alone. The coefficient of `static` friction, for starting, is by default the same. Raises `ValueError` for a
    negative coefficient, an angle that is not above 0 and below 90°, a length that is not above zero, a factor outside
    of 1 to π/2, and for both a groove and a seat. Source: as for `elements.slider`; Artobolevsky, Theory of Mechanisms
    and Machines, 1988, ch. 11.
    """

    link: str = eqx.field(static=True)
    coefficient: Array = eqx.field(converter=as_float)
    groove: Array | None = eqx.field(converter=as_float, default=None)
    length: Array | None = eqx.field(converter=as_float, default=None)
    seat: Array | None = eqx.field(converter=as_float, default=None)
    static: Array | None = eqx.field(converter=as_float, default=None)

    def __check_init__(self):
        _not_negative(f"the guide of {self.link!r}", "static", self.static)
        _not_negative(f"the guide of {self.link!r}", "coefficient", self.coefficient)
        if self.groove is not None and self.seat is not None:
            raise ValueError(f"the guide of {self.link!r} has a groove and a curved seat; omit one of them")
        self.equivalent()
        length = None if self.length is None else known(self.length)
        if length is not None and not np.all((length > 0) & np.isfinite(length)):
            raise ValueError(f"length of the guide of {self.link!r} is {length}; write a finite number above zero")

    @property
    def joint(self):
        return f"{self.link}.guide"

    def size(self, fx, fy, moment):
        normal = safe_sqrt(fx * fx + fy * fy)
        f0 = self.equivalent()
        if self.length is None:
            return f0 * normal
        return f0 * jnp.maximum(normal, 2 * jnp.abs(moment) / self.length)

    def equivalent(self) -> Array:
        """The equivalent coefficient f₀."""
        if self.groove is not None:
            return groove_friction(self.coefficient, self.groove)
        return self.coefficient if self.seat is None else seat_friction(self.coefficient, self.seat)

    def switches(self, normal, moment):
        if self.length is None:
            return (normal,)
        edges = 2 * moment / self.length  # max(|a|, |b|) = ½ (|a − b| + |a + b|)
        return normal - edges, normal + edges

    @property
    def kinks(self):
        return 1 if self.length is None else 2

    def at_rest(self):
        return self if self.static is None else dataclasses.replace(self, coefficient=self.static, static=None)


class MeshFriction(AbstractFriction):
    """Losses of two gears in mesh, of a gear and a rack, or of a belt: of the power that goes through the mesh,
    relative to the link that carries both, it loses the share 1 - η, with the `efficiency` η in either direction.

    It is the mesh of the gear or rack `link`; where that is in several meshes of one group, that with the link `to`.
    The loss is a couple between the gear and its carrier, or a force between the rack and its guide, against the
    relative motion: (1 - η) of what drives it, and (1/η - 1) of what it drives. Tooth forces are those without
    friction. Raises `ValueError` for an efficiency that is not above zero and up to one. Source: Artobolevsky, Theory
    of Mechanisms and Machines, 1988, ch. 14, for gears in series and on a moving carrier.
    """

    link: str = eqx.field(static=True)
    efficiency: Array = eqx.field(converter=as_float)
    to: str = eqx.field(static=True, default="")

    def __check_init__(self):
        value = known(self.efficiency)
        if value is not None and not np.all((value > 0) & (value <= 1)):
            raise ValueError(
                f"efficiency of the mesh {self.joint!r} is {value}; write a number above 0 and up to 1, e.g. 0.98"
            )

    @property
    def joint(self):
        return f"{self.link}.{self.to}.mesh" if self.to else f"{self.link}.mesh"

    def size(self, fx, fy, moment):
        lost = 1 - self.efficiency
        return jnp.maximum(lost * fx, -lost / self.efficiency * fx)

    def switches(self, normal, moment):
        return (normal,)

    @property
    def kinks(self):
        return 1


def mesh_friction(joint: Joint, efficiency: Any) -> MeshFriction:
    """The losses of a mesh, by its joint."""
    single = joint.name == f"{joint.link}.mesh"
    return MeshFriction(joint.link, efficiency, "" if single else joint.by or "")


def everywhere(
    mechanism: Mechanism,
    coefficient: Any,
    radius: Any,
    guide: Any = None,
    bearing: Any = "given",
    mesh: Any = None,
) -> tuple[AbstractFriction, ...]:
    """The same friction in all joints: pins with this `coefficient`, `radius` (m) and `bearing`, guides with the
    coefficient `guide`, by default that of the pins, and meshes with the efficiency `mesh`, by default without loss."""
    found: dict[str, AbstractFriction] = {}
    for joint in friction_joints(mechanism):
        if joint.meshes:
            if mesh is not None:
                found[joint.name] = mesh_friction(joint, mesh)
        elif joint.slides:
            found[joint.name] = GuideFriction(joint.link, coefficient if guide is None else guide)
        else:
            found[joint.name] = PinFriction(joint.point, coefficient, radius, bearing)
    return tuple(found.values())


def friction_joints(mechanism: Mechanism) -> list[Joint]:
    """The joints that may have friction: all but the joint that drives."""
    return [joint for group in mechanism.groups for joint in group.joints() if not joint.drives]


def joint_kind(joint: str) -> str:
    """The kind of joint that a name is for: "pin", "guide" or "mesh"."""
    return "guide" if joint.endswith(".guide") else "mesh" if joint.endswith(".mesh") else "pin"


def check_friction(mechanism: Mechanism, friction: Any) -> None:
    """Raise `StructureError` for anything but a tuple of frictions, for a joint that the mechanism does not have, for
    two frictions of one joint, and for a joint whose reactions are not unique in a mechanism with redundant links."""
    if not isinstance(friction, tuple) or not all(isinstance(each, AbstractFriction) for each in friction):
        problem, remedy = (
            f"is {type(friction).__name__}",
            "write a tuple of PinFriction, GuideFriction and MeshFriction",
        )
        raise StructureError("friction", problem, remedy)
    there = friction_joints(mechanism)
    names = [joint.name for joint in there]
    seen: set[str] = set()
    for number, each in enumerate(friction):
        element, kind = f"friction[{number}] ({each.joint})", joint_kind(each.joint)
        own = {name for name in names if joint_kind(name) == kind}
        if each.joint not in own:
            raise StructureError(element, f"there is no {kind} {each.joint!r}", nearest(each.joint, sorted(own)))
        if each.joint in seen:
            raise StructureError(element, "the joint has a friction already", "give every joint one friction")
        seen.add(each.joint)
    numbers = jax.tree.leaves(mechanism)
    if not seen or any(isinstance(leaf, Tracer) or leaf.ndim for leaf in numbers):
        return  # derivatives and batches of a scene that was checked
    if shared := [name for name in indeterminate(mechanism) if name in seen]:
        problem = f"redundant links share the reactions of {', '.join(shared)}, which are not unique"
        raise StructureError("friction", problem, "give these joints no friction (coefficient 0), or omit the links")


def _not_negative(owner: str, name: str, value: Any) -> None:
    number = None if value is None else known(value)
    if number is not None and not np.all((number >= 0) & np.isfinite(number)):
        raise ValueError(f"{name} of {owner} is {number}; write a finite number of zero or more")
