"""The tables `[friction]` and `[joints]` of a scene file: friction in all joints, and in single ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, StrictBool

from linkjax.elements import MATERIALS, material_friction
from linkjax.friction import (
    AbstractFriction,
    GuideFriction,
    MeshFriction,
    PinFriction,
    Thrust,
    friction_joints,
    joint_kind,
    mesh_friction,
)
from linkjax.mechanism import Mechanism, StructureError
from linkjax.scenes._fields import Quantity, Radius, Table, amount, checked_name, number_of
from linkjax.scenes._guides import Fault

Coefficient = Annotated[float, Quantity("number", "zero")]
Axial = Annotated[float, Quantity("force", "zero")]
Reach = Annotated[float, Quantity("length", "zero")]
Efficiency = Annotated[float, Quantity("number", "positive")]
Bearing = Literal["given", "unworn", "run-in"]
GUIDE, MESH = ".guide", ".mesh"


def _joint(value: str) -> str:
    for part in value.removesuffix(MESH).split(".") if value.endswith(MESH) else (value.removesuffix(GUIDE),):
        checked_name(part)
    return value


JointName = Annotated[str, AfterValidator(_joint)]


class ThrustTable(Table):
    """A thrust face of a pin, under a given axial force."""

    force: Axial = Field(description="the axial force", examples=["2 kN"])
    outer: Radius = Field(description="outer radius of the face", examples=["40 mm"])
    inner: Reach = Field(0.0, description="its inner radius", examples=["25 mm"])
    coefficient: Coefficient | None = Field(None, description="default: that of the pin", examples=[0.1])
    bearing: Literal["unworn", "run-in"] = Field("unworn", description="how the pressure is distributed")

    def build(self, coefficient: float) -> Thrust:
        """The thrust face, with the coefficient of its pin if it has none."""
        own = coefficient if self.coefficient is None else self.coefficient
        return Thrust(self.force, self.outer, own, self.inner, self.bearing)


class Rubs(Table):
    """What `[friction]` and the tables of `[joints]` have in common."""

    coefficient: Coefficient | None = Field(None, description="coefficient of friction", examples=[0.1])
    static: Coefficient | None = Field(
        None, description="coefficient of static friction, for starting; default: coefficient", examples=[0.15]
    )
    material: str | None = Field(
        None, description=f"instead of it, two materials: {', '.join(MATERIALS)}", examples=["steel-bronze"]
    )
    lubricated: StrictBool | None = Field(None, description="with material: lubricated or dry", examples=[True])
    radius: Reach | None = Field(None, description="radius of the journal of a pin", examples=["20 mm"])
    mean_diameter: Radius | None = Field(
        None, description="instead of it: mean diameter of a rolling bearing", examples=["46 mm"]
    )
    bearing: Bearing | None = Field(
        None,
        description='how a journal is worn: "unworn", "run-in", or "given", where the coefficient is that of the '
        'journal already; default: "given"',
        examples=["run-in"],
    )

    def size(self, lubricated: bool | None = None) -> float | None:
        """The coefficient, of materials that are `lubricated` if it is not said here; None if it is not given here."""
        if self.material is None:
            return self.coefficient
        wet = lubricated if self.lubricated is None else self.lubricated
        return material_friction(self.material, lubricated=bool(wet))

    def at_rest(self, lubricated: bool | None = None) -> float | None:
        """The coefficient of static friction; None if it is not given here, or is not known for the materials."""
        if self.static is not None or self.material is None:
            return self.static
        wet = lubricated if self.lubricated is None else self.lubricated
        try:
            return material_friction(self.material, lubricated=bool(wet), static=True)
        except ValueError:
            return None

    def arm(self) -> float | None:
        """The radius at which a pin rubs (m); None if it is not given here."""
        return self.radius if self.mean_diameter is None else self.mean_diameter / 2

    def faults(self, path: tuple[str, ...]) -> Iterator[Fault]:
        """The contradictions between its keys."""
        for one, other in (("coefficient", "material"), ("radius", "mean_diameter")):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                yield (*path, other), f"given, and {one} too", f"delete {other}, or {one}"
        if self.mean_diameter is not None and self.bearing not in (None, "given"):
            problem = "has no effect: the coefficient of a rolling bearing is not that of a worn journal"
            yield (*path, "bearing"), problem, "delete bearing, or mean_diameter"
        if self.lubricated is not None and self.material is None:
            yield (*path, "lubricated"), "has no effect without a material", "delete it, or add a material"
        if self.material is not None:
            try:
                self.size()
            except ValueError as error:
                problem, remedy = _said(error)
                yield (*path, "material"), problem, remedy.replace("friction as a number", "coefficient instead")


class FrictionTable(Rubs):
    """Friction in all joints."""

    guide: Coefficient | None = Field(
        None, description="coefficient of the guides; default: that of the pins", examples=[0.12]
    )
    mesh_efficiency: Efficiency | None = Field(
        None, description="efficiency of every mesh; default: without loss", examples=[0.98]
    )


class JointTable(Rubs):
    """Friction in one joint; what is not given is that of `[friction]`."""

    thrust: ThrustTable | None = Field(
        None, description="of a pin: a thrust face", examples=[{"force": "2 kN", "outer": "40 mm"}]
    )
    groove: Annotated[float, Quantity("angle", "positive")] | None = Field(
        None, description="of a guide: half angle of a wedge-shaped groove", examples=["45 deg"]
    )
    seat: Annotated[float, Quantity("number", "positive")] | None = Field(
        None, description="of a guide: factor of a curved seat, from 1 to 1.57", examples=[1.27]
    )
    length: Radius | None = Field(
        None, description="of a guide: its length, whose edges carry a tilting moment", examples=["120 mm"]
    )
    efficiency: Efficiency | None = Field(
        None, description="of a mesh: power that leaves it over power that goes in", examples=[0.97]
    )


COEFFICIENTS = ("coefficient", "static", "material", "lubricated")
KEYS = {  # of every kind of joint
    "pin": (*COEFFICIENTS, "radius", "mean_diameter", "bearing", "thrust"),
    "guide": (*COEFFICIENTS, "groove", "seat", "length"),
    "mesh": ("efficiency",),
}


def friction_faults(friction: FrictionTable | None, joints: dict[str, JointTable]) -> Iterator[Fault]:
    """The contradictions between the keys of the tables."""
    if friction is not None:
        yield from friction.faults(("friction",))
        if friction.size() is None and friction.guide is None and friction.mesh_efficiency is None:
            yield ("friction", "coefficient"), "missing", "add coefficient = 0.1, or a material"
        elif friction.size() is None and not any(
            joint_kind(name) == "pin" and (joint.coefficient is not None or joint.material is not None)
            for name, joint in joints.items()
        ):
            for key in ("radius", "mean_diameter"):
                if getattr(friction, key) is not None:
                    remedy = "add coefficient = 0.1, or coefficient = 0 for pins without friction, or delete it"
                    yield ("friction", key), "has no effect: no pin has a coefficient of friction", remedy
        yield from _share(friction.mesh_efficiency, ("friction", "mesh_efficiency"))
    for name, joint in joints.items():
        path = ("joints", name)
        yield from joint.faults(path)
        kind = joint_kind(name)
        for key in dict.fromkeys(key for keys in KEYS.values() for key in keys):
            others = [other for other, keys in KEYS.items() if key in keys]
            if kind not in others and getattr(joint, key) is not None:
                remedy = f"delete it; it is a key of a {' or a '.join(others)}"
                yield (*path, key), f"has no effect: {name} is a {kind}", remedy
        yield from _share(joint.efficiency, (*path, "efficiency"))
        if joint.groove is not None and joint.seat is not None:
            yield (*path, "seat"), "given, and groove too", "delete seat, or groove"
        try:
            GuideFriction("", 0.0, joint.groove, joint.length, joint.seat)
        except ValueError as error:
            yield (*path, "seat" if joint.groove is None else "groove"), *_said(error)
        try:
            PinFriction("", 0.0, 0.0, "given", None if joint.thrust is None else joint.thrust.build(0.0))
        except ValueError as error:
            yield (*path, "thrust"), *_said(error)


def _share(value: float | None, path: tuple[str, ...]) -> Iterator[Fault]:
    """The fault of an efficiency above one."""
    if value is not None and value > 1:
        yield path, "is above one", "write a number up to 1, e.g. 0.98"


def _said(error: ValueError) -> tuple[str, str]:
    """Problem and remedy of an error."""
    problem, _, remedy = str(error).partition("; ")
    return problem, remedy


def frictions(
    friction: FrictionTable | None, joints: dict[str, JointTable], mechanism: Mechanism
) -> tuple[AbstractFriction, ...]:
    """The friction of every joint that has some. Raises `StructureError` for a joint that the mechanism does not have,
    for a pin without radius, and for a joint without coefficient."""
    there = {joint.name: joint for joint in friction_joints(mechanism)}
    for name in joints:
        if name not in there:
            kind = joint_kind(name)
            known = ", ".join(each for each in there if joint_kind(each) == kind)
            raise StructureError(f"joints.{name}", f"there is no such {kind}", f"write one of {known or 'none'}")
    common, found = friction or FrictionTable.model_validate({}), []
    for name, joint in there.items():
        if friction is None and name not in joints:
            continue
        own, place = joints.get(name) or JointTable.model_validate({}), f"joints.{name}"
        if joint.meshes:
            share = _first(own.efficiency, common.mesh_efficiency, 1.0)
            found += [] if share == 1 else [mesh_friction(joint, share)]
            continue
        given = _first(own.size(common.lubricated), common.guide if joint.slides else None, common.size())
        if given is None and name in joints:
            raise StructureError(place, "has no coefficient of friction", "add coefficient = 0.1, or a material")
        if given is None or (not given and own.thrust is None):
            continue
        other = own.coefficient is not None or own.material is not None or (joint.slides and common.guide is not None)
        static = _first(own.at_rest(common.lubricated), None if other else common.at_rest())
        if joint.slides:
            found.append(GuideFriction(joint.link, given, own.groove, own.length, own.seat, static))
            continue
        radius = _first(own.arm(), common.arm())
        if radius is None:
            remedy = 'add radius = "20 mm" to [friction] or to the table of the joint'
            raise StructureError(place, "the pin has no radius, at which it rubs", remedy)
        rolls = own.mean_diameter is not None or (own.radius is None and common.mean_diameter is not None)
        bearing: Bearing = own.bearing or ("given" if rolls else common.bearing) or "given"
        thrust = None if own.thrust is None else own.thrust.build(given)
        found.append(PinFriction(joint.point, given, radius, bearing, thrust, static))
    return tuple(found)


def _first(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)


def friction_keys(friction: tuple[AbstractFriction, ...]) -> dict[str, Any]:
    """The table `[joints]` of the friction of a scene. Raises `StructureError` for kinds that scene files do not
    support, and for numbers that are traced or batched."""
    return {each.joint: _keys(each) for each in friction}


def _keys(each: AbstractFriction) -> dict[str, Any]:
    if isinstance(each, MeshFriction):
        return {"efficiency": number_of(each.efficiency)}
    static = getattr(each, "static", None)
    rest = {} if static is None else {"static": number_of(static)}
    if isinstance(each, GuideFriction):
        table: dict[str, Any] = {"coefficient": number_of(each.coefficient), **rest}
        table |= {} if each.groove is None else {"groove": amount(each.groove, "rad")}
        table |= {} if each.length is None else {"length": amount(each.length, "m")}
        return table | ({} if each.seat is None else {"seat": number_of(each.seat)})
    if not isinstance(each, PinFriction):
        problem = f"scene files do not support friction of the kind {type(each).__name__}"
        raise StructureError(f"joints.{each.joint}", problem, "write PinFriction, GuideFriction or MeshFriction")
    table = {"coefficient": number_of(each.coefficient), **rest, "radius": amount(each.radius, "m")}
    table |= {} if each.bearing == "given" else {"bearing": each.bearing}
    if each.thrust is None:
        return table
    face = each.thrust
    ends = {"force": amount(face.force, "N"), "outer": amount(face.outer, "m"), "inner": amount(face.inner, "m")}
    return {**table, "thrust": {**ends, "coefficient": number_of(face.coefficient), "bearing": face.bearing}}
