"""The loads in a scene file, one class for each kind; a new kind is a new class, and a branch of `Load`.

Each class defines its keys, the conditions between them (`faults`), how to `build` the load, and how to write it
(`keys_of`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, StrictBool, Tag

from linkjax import loads
from linkjax._vec import Vec
from linkjax.groups import FRAME
from linkjax.mechanism import StructureError
from linkjax.scenes._fields import (
    Angle,
    Damping,
    Force,
    LinkLength,
    Magnitude,
    Name,
    Pair,
    QuadraticDrag,
    QuadraticDragTorque,
    Stiffness,
    Table,
    Torque,
    TorsionalDamping,
    TorsionalStiffness,
    amount,
)
from linkjax.scenes._guides import Fault
from linkjax.scenes._load import REACTS, LoadTable
from linkjax.scenes._load_tables import GasTable, TabulatedForce, TabulatedTorque
from linkjax.scenes._passages import window_keys


def _vector(value: Any) -> str:
    return "#vector" if isinstance(value, list | tuple) else "#scalar"


class WorkingLoad(LoadTable):
    """A force at a point of a link, or a torque on a link."""

    kind: Literal["force", "torque"] | None = Field(
        None, description="what it is; follows from its keys", examples=["force"]
    )
    point: Name | None = Field(None, description="the point of that link where a force acts", examples=["D"])
    force: (
        Annotated[
            Annotated[Magnitude, Tag("#scalar")] | Annotated[tuple[Force, Force], Pair, Tag("#vector")],
            Discriminator(_vector),
        ]
        | None
    ) = Field(None, description="magnitude (with opposing = true) or [fx, fy]", examples=["30 kN"])
    torque: Torque | None = Field(
        None, description="torque, ccw positive; a magnitude when opposing", examples=["60 N m"]
    )
    opposing: StrictBool = Field(False, description="acts against the motion of the point or link", examples=[True])
    reacts_on: Literal["frame"] | None = REACTS

    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        always = {**self.shared(), "reacts_on": self.reacts_on}
        if self.torque is not None:
            kind = loads.OpposingTorque if self.opposing else loads.Torque
            return kind(**{"magnitude" if self.opposing else "torque": self.torque}, **always)
        always["point"] = self.point
        if isinstance(self.force, tuple):
            return loads.Force(force=Vec(*self.force), **always)
        return loads.OpposingForce(magnitude=self.force, **always)

    @staticmethod
    def keys_of(load: Any) -> dict[str, Any]:
        at = {"point": load.point} if load.point else {}
        if isinstance(load, loads.Force):
            table = {**at, "force": [amount(load.force.x, "N"), amount(load.force.y, "N")]}
        elif isinstance(load, loads.OpposingForce):
            table = {**at, "force": amount(load.magnitude, "N"), "opposing": True}
        elif isinstance(load, loads.Torque):
            table = {"torque": amount(load.torque, "N m")}
        else:
            table = {"torque": amount(load.magnitude, "N m"), "opposing": True}
        return {**table, "reacts_on": load.reacts_on} if load.reacts_on else table

    def faults(self) -> Iterator[Fault]:
        if self.force is None and self.torque is None:
            what = "torque" if self.kind == "torque" else "force"
            add = 'add force = "30 kN" with opposing = true, force = [fx, fy], or torque = "60 N m"'
            yield (what,), "missing", f'{add}; a spring, damper or drag has a kind, e.g. kind = "spring"'
        elif self.torque is not None:
            yield from self._faults_of_torque(self.torque)
        else:
            if self.kind == "torque":
                yield ("kind",), "has a force", 'delete kind, or write torque = "60 N m"'
            if self.point is None:
                yield ("point",), "missing", "add the point of the link where the force acts"
            if self.opposing and isinstance(self.force, tuple):
                problem = "two components, but opposing = true: the motion gives the direction"
                yield ("force",), problem, 'write the magnitude alone, e.g. force = "30 kN", or delete opposing'
            if not self.opposing and not isinstance(self.force, tuple):
                remedy = 'add opposing = true, or write both components, e.g. force = ["0 N", "-3 kN"]'
                yield ("force",), "has no direction", remedy

    def _faults_of_torque(self, torque: float) -> Iterator[Fault]:
        if self.force is not None:
            yield ("torque",), "a load is a force or a torque, not both", "write two [[loads]]"
        if self.kind == "force":
            yield ("kind",), "has a torque", 'delete kind, or write force = "30 kN"'
        if self.point is not None:
            yield ("point",), "a torque has no point", "delete point"
        if self.opposing and torque < 0:
            remedy = "write the magnitude; the motion gives the direction of an opposing torque"
            yield ("torque",), "must not be negative", remedy


class PointOfLink(Table):
    """A point of a link."""

    link: Name = Field(description="the link", examples=["rocker"])
    point: Name = Field(description="the point of that link", examples=["G"])


def _end(value: Any) -> str:
    return "#link" if isinstance(value, dict) else "#frame"


End = Annotated[
    Annotated[Name, Tag("#frame")] | Annotated[PointOfLink, Tag("#link")], Discriminator(_end)
]  # fmt: skip
TO_POINT: Any = Field(
    description="the other end: a point of the frame, or a point of another link", examples=["A"]
)  # fmt: skip
TO_LINK: Any = Field(FRAME, description="the other end: another link, or the frame", examples=["rocker"])


class BetweenPoints(LoadTable):
    """A load between a point of a link and a point of the frame or of another link."""

    point: Name = Field(description="the point of that link where it is attached", examples=["D"])
    to: End = TO_POINT

    def ends(self) -> dict[str, Any]:
        """The arguments of its ends, and those of every kind of load."""
        other = self.to
        link, point = (other.link, other.point) if isinstance(other, PointOfLink) else (FRAME, other)
        return {**self.shared(), "point": self.point, "to_link": link, "to_point": point}

    @staticmethod
    def keys_of_ends(load: Any) -> dict[str, Any]:
        """The keys of its ends."""
        other = {"link": load.to_link, "point": load.to_point}
        return {"point": load.point, "to": load.to_point if load.to_link == FRAME else other}


class BetweenLinks(LoadTable):
    """A load between a link and the frame or another link."""

    to: Name = TO_LINK

    def ends(self) -> dict[str, Any]:
        """The arguments of its ends, and those of every kind of load."""
        return {**self.shared(), "to_link": self.to}

    @staticmethod
    def keys_of_ends(load: Any) -> dict[str, Any]:
        """The key of its other end."""
        return {} if load.to_link == FRAME else {"to": load.to_link}


class SpringTable(BetweenPoints):
    """A spring between two points."""

    kind: Literal["spring"] = Field(description="a spring between two points", examples=["spring"])
    stiffness: Stiffness = Field(description="force for a change of length; 0: constant", examples=["2 kN/m"])
    free_length: LinkLength = Field(0.0, description="length at which only the preload acts", examples=["80 mm"])
    preload: Force = Field(0.0, description="tension at the free length", examples=["25 N"])

    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        sizes: dict[str, Any] = {"stiffness": self.stiffness, "free_length": self.free_length}
        return loads.Spring(**self.ends(), **sizes, preload=self.preload)

    @staticmethod
    def keys_of(load: loads.Spring) -> dict[str, Any]:
        return {**BetweenPoints.keys_of_ends(load), "stiffness": amount(load.stiffness, "N/m"),
                "free_length": amount(load.free_length, "m"), "preload": amount(load.preload, "N")}  # fmt: skip


class TorsionSpringTable(BetweenLinks):
    """A torsion spring between a link and the frame, or between two links."""

    kind: Literal["torsion_spring"] = Field(
        description="a torsion spring between two links", examples=["torsion_spring"]
    )
    stiffness: TorsionalStiffness = Field(
        description="couple for a change of angle; 0: constant", examples=["5 N m/rad"]
    )
    free_angle: Angle = Field(description="angle at which only the preload acts", examples=["60 deg"])
    preload: Torque = Field(0.0, description="couple at the free angle, clockwise on the link", examples=["2 N m"])

    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        sizes: dict[str, Any] = {"stiffness": self.stiffness, "free_angle": self.free_angle}
        return loads.TorsionSpring(**self.ends(), **sizes, preload=self.preload)

    @staticmethod
    def keys_of(load: loads.TorsionSpring) -> dict[str, Any]:
        return {**BetweenLinks.keys_of_ends(load), "stiffness": amount(load.stiffness, "N m/rad"),
                "free_angle": amount(load.free_angle, "rad"), "preload": amount(load.preload, "N m")}  # fmt: skip


class DamperTable(BetweenPoints):
    """A viscous damper between two points."""

    kind: Literal["damper"] = Field(description="a viscous damper between two points", examples=["damper"])
    coefficient: Damping = Field(description="force for a rate of length", examples=["200 N s/m"])

    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        return loads.Damper(**self.ends(), coefficient=self.coefficient)

    @staticmethod
    def keys_of(load: loads.Damper) -> dict[str, Any]:
        return {**BetweenPoints.keys_of_ends(load), "coefficient": amount(load.coefficient, "N s/m")}


class TorsionDamperTable(BetweenLinks):
    """A viscous torsion damper between a link and the frame, or between two links."""

    kind: Literal["torsion_damper"] = Field(
        description="a viscous torsion damper between two links", examples=["torsion_damper"]
    )
    coefficient: TorsionalDamping = Field(
        description="couple for a relative angular velocity", examples=["0.5 N m s/rad"]
    )

    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        return loads.TorsionDamper(**self.ends(), coefficient=self.coefficient)

    @staticmethod
    def keys_of(load: loads.TorsionDamper) -> dict[str, Any]:
        return {**BetweenLinks.keys_of_ends(load), "coefficient": amount(load.coefficient, "N m s/rad")}


class InFluid(LoadTable):
    """A load by a fluid at rest."""

    reacts_on: Literal["frame"] | None = REACTS

    def faults(self) -> Iterator[Fault]:
        if not {"linear", "quadratic"} & self.model_fields_set:
            (example,) = type(self).model_fields["linear"].examples or [0]
            yield ("linear",), "missing", f'add linear = "{example}", or quadratic'

    @staticmethod
    def reaction(load: Any) -> dict[str, Any]:
        """The key of its reaction."""
        return {"reacts_on": load.reacts_on} if load.reacts_on else {}


class DragTable(InFluid):
    """The drag of a fluid on a point of a link."""

    kind: Literal["drag"] = Field(description="the drag of a fluid on a point", examples=["drag"])
    point: Name = Field(description="the point of that link", examples=["D"])
    linear: Damping = Field(0.0, description="force in proportion to the velocity", examples=["200 N s/m"])
    quadratic: QuadraticDrag = Field(
        0.0, description="force in proportion to the square of the velocity", examples=["0.8 N s^2/m^2"]
    )

    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        always = {**self.shared(), "reacts_on": self.reacts_on}
        return loads.Drag(point=self.point, linear=self.linear, quadratic=self.quadratic, **always)

    @staticmethod
    def keys_of(load: loads.Drag) -> dict[str, Any]:
        return {"point": load.point, "linear": amount(load.linear, "N s/m"),
                "quadratic": amount(load.quadratic, "N s^2/m^2"), **InFluid.reaction(load)}  # fmt: skip


class DragTorqueTable(InFluid):
    """The drag torque of a fluid on a link."""

    kind: Literal["drag_torque"] = Field(description="the drag torque of a fluid on a link", examples=["drag_torque"])
    linear: TorsionalDamping = Field(
        0.0, description="torque in proportion to the angular velocity", examples=["0.5 N m s/rad"]
    )
    quadratic: QuadraticDragTorque = Field(
        0.0, description="torque in proportion to the square of the angular velocity", examples=["2e-4 N m s^2/rad^2"]
    )

    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        always = {**self.shared(), "reacts_on": self.reacts_on}
        return loads.DragTorque(linear=self.linear, quadratic=self.quadratic, **always)

    @staticmethod
    def keys_of(load: loads.DragTorque) -> dict[str, Any]:
        return {"linear": amount(load.linear, "N m s/rad"),
                "quadratic": amount(load.quadratic, "N m s^2/rad^2"), **InFluid.reaction(load)}  # fmt: skip


TABLES: dict[type[loads.AbstractLoad], tuple[str, type[LoadTable]]] = {  # kind and table of a load, by its class
    loads.Force: ("", WorkingLoad),
    loads.OpposingForce: ("", WorkingLoad),
    loads.Torque: ("", WorkingLoad),
    loads.OpposingTorque: ("", WorkingLoad),
    loads.Spring: ("spring", SpringTable),
    loads.TorsionSpring: ("torsion_spring", TorsionSpringTable),
    loads.Damper: ("damper", DamperTable),
    loads.TorsionDamper: ("torsion_damper", TorsionDamperTable),
    loads.Drag: ("drag", DragTable),
    loads.DragTorque: ("drag_torque", DragTorqueTable),
    loads.Table: ("table", TabulatedForce),  # a TabulatedTorque has the same keys, except those of a point
    loads.Gas: ("gas", GasTable),
}


def load_keys(load: loads.AbstractLoad) -> dict[str, Any]:
    """A load as a table of a scene file. Raises `StructureError` for a load that scene files do not support."""
    if type(load) not in TABLES:
        kinds = ", ".join(name for name in dict.fromkeys(name for name, _ in TABLES.values()) if name)
        raise StructureError(load.name, "scene files do not support loads of this kind",
                             f"write a force, a torque, or one of {kinds}")  # fmt: skip
    kind, table = TABLES[type(load)]
    keys = {"name": load.name, **({"kind": kind} if kind else {}), "link": load.link, **table.keys_of(load)}
    return keys if load.window is None else {**keys, "window": window_keys(load.name, load.window)}


def _kind(value: Any) -> str | None:
    kind = value.get("kind", "force") if isinstance(value, dict) else "force"
    if not isinstance(kind, str):
        return None
    if kind == "table" and "point" not in value:
        return "#table-torque"
    return "#force" if kind == "torque" else f"#{kind}"


Load = Annotated[
    Annotated[WorkingLoad, Tag("#force")]
    | Annotated[SpringTable, Tag("#spring")]
    | Annotated[TorsionSpringTable, Tag("#torsion_spring")]
    | Annotated[DamperTable, Tag("#damper")]
    | Annotated[TorsionDamperTable, Tag("#torsion_damper")]
    | Annotated[DragTable, Tag("#drag")]
    | Annotated[DragTorqueTable, Tag("#drag_torque")]
    | Annotated[TabulatedForce, Tag("#table")]
    | Annotated[TabulatedTorque, Tag("#table-torque")]
    | Annotated[GasTable, Tag("#gas")],
    Discriminator(_kind),
]
