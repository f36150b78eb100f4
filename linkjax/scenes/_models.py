"""The format of a scene file, as pydantic models: keys, defaults, examples (groups: `_groups.py`).

Descriptions and examples feed the error messages and the JSON Schema. A table that may be written in several ways is a
union whose branches carry tags that begin with `#`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Discriminator, Field, StrictBool, Tag

from linkjax.scenes._fields import (
    Acceleration,
    Angle,
    Area,
    Density,
    Distance,
    Inertia,
    Length,
    LinkLength,
    Mass,
    Name,
    Pair,
    Ratio,
    Side,
    Speed,
    Table,
    Thickness,
    Turns,
    Weight,
)
from linkjax.scenes._friction import FrictionTable, JointName, JointTable
from linkjax.scenes._groups import BRANCH, Branch, Group
from linkjax.scenes._joints import Drive, Slot
from linkjax.scenes._loads import Load
from linkjax.scenes._motors import Motor
from linkjax.scenes._optimise import Optimise
from linkjax.scenes._wheels import GearPair, RackPair


class Polar(Table):
    """A point on a link in polar form: distance from the first pin, angle from the link's direction."""

    at: Distance = Field(description="distance from the link's first pin", examples=["450 mm"])
    turned: Angle = Field(0.0, description="angle from the link's direction, ccw", examples=["30 deg"])


class Cartesian(Table):
    """A point on a link in the link's own axes: origin at the first pin, x towards the second."""

    along: Length = Field(description="along the link from its first pin", examples=["200 mm"])
    across: Length = Field(0.0, description="to the left of the link", examples=["40 mm"])


def _place(value: Any) -> str:
    if isinstance(value, dict):
        return "#polar" if {"at", "turned"} & set(value) else "#cartesian"
    return "#along"


Place = Annotated[
    Annotated[Length, Tag("#along")] | Annotated[Polar, Tag("#polar")] | Annotated[Cartesian, Tag("#cartesian")],
    Discriminator(_place),
]


def _corners(value: Any) -> str:
    return "#corners" if isinstance(value, list | tuple) else "#bar"


def _vector(value: Any) -> str:
    return "#vector" if isinstance(value, list | tuple) else "#scalar"


class Counterweight(Table):
    """A counterweight fixed to a link."""

    may_be_added: ClassVar[bool] = True  # by `--set` and `[optimise.changes]`

    mass: Mass = Field(description="mass", examples=["12 kg"])
    at: Place = Field(description="its mass centre, from the first pin of the link", examples=["-150 mm"])
    inertia: Inertia | None = Field(None, description="moment of inertia about its own centre", examples=["0.1 kg m^2"])
    thickness: Thickness | None = Field(None, description="thickness, if it is a disc", examples=["60 mm"])
    density: Density | None = Field(None, description="density, if it is a disc", examples=["7850 kg/m^3"])
    ideal: StrictBool = Field(False, description="adds only the mass moment m r: no mass, no inertia", examples=[True])


class Link(Table):
    """One link: a bar between two pins, or a slider (block) without length."""

    pins: list[Name] = Field([], description="its joints, in a scene without groups", examples=[["A", "B"]])
    length: LinkLength = Field(0.0, description="distance between its two pins; none for a slider", examples=["300 mm"])
    sides: dict[str, Side] = Field(
        {}, description="distances between three or more pins, instead of a length; in a scene without groups",
        examples=[{"E-F": "250 mm", "F-G": "180 mm", "G-E": "300 mm"}],
    )  # fmt: skip
    mass: Mass = Field(0.0, description="mass", examples=["5 kg"])
    inertia: Inertia = Field(0.0, description="moment of inertia about the mass centre", examples=["0.65 kg m^2"])
    centre: Place = Field(0.0, description="mass centre, from the first pin", examples=["150 mm"])
    centre_name: Name = Field("", description="name of the mass centre; S1, S2, … in file order", examples=["S2"])
    points: dict[Name, Place] = Field(
        {},
        description="coupler points and other additional points",
        examples=[{"E": {"at": "450 mm", "turned": "30 deg"}}],
    )
    counterweights: dict[Name, Counterweight] = Field(
        {}, description="counterweights by name", examples=[{"W1": {"mass": "12 kg", "at": "-150 mm"}}]
    )
    uniform: Annotated[
        Annotated[StrictBool, Tag("#bar")] | Annotated[list[Name], Tag("#corners")], Discriminator(_corners)
    ] = Field(
        False,
        description="centre and inertia follow from the mass: true for a slender uniform bar between its two pins, or "
        "the corner points of a uniform plate, in order",
        examples=[True, ["B", "C", "E"]],
    )
    mass_properties: Literal["fixed", "scaled", "stretched", "section"] = Field(
        "fixed", description="how the mass properties follow the length", examples=["scaled"]
    )
    reference_length: LinkLength | None = Field(
        None,
        description='with "scaled" and "stretched": the length to which mass, inertia, centre and points belong',
        examples=["1 m"],
    )
    area: Area | None = Field(None, description="cross-section of a uniform bar", examples=["600 mm^2"])
    density: Density | None = Field(None, description="density of a uniform bar", examples=["7850 kg/m^3"])


class Flywheel(Table):
    """The flywheel on the crankshaft, or on a shaft that gears couple with it."""

    inertia: Inertia = Field(default=0.0, description="moment of inertia about its shaft", examples=["40 kg m^2"])
    ratio: Ratio = Field(default=1.0, description="speed of its shaft over crank speed", examples=[4.5])


class SceneFile(Table):
    """A machine: links, groups, loads, gravity and speed. Quantities are strings with a unit."""

    model_config = ConfigDict(
        title="linkjax scene",
        json_schema_extra={"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": "linkjax-scene"},
    )

    title: str = Field("", description="title in reports", examples=["Hay press"])
    gravity: Annotated[
        Annotated[Weight, Tag("#scalar")] | Annotated[tuple[Acceleration, Acceleration], Pair, Tag("#vector")],
        Discriminator(_vector),
    ] = Field(0.0, description="acceleration of gravity, downwards, or [gx, gy]", examples=["9.81 m/s^2"])
    speed: Speed = Field(description="mean speed of the crank", examples=["700 rpm"])
    mean: Literal["time", "midrange"] = Field(
        "time", description="which mean of the crank speed `speed` is", examples=["midrange"]
    )
    cycle_turns: Turns = Field(1, description="crank turns per cycle", examples=[2])
    constant_speed: StrictBool = Field(
        False,
        description="the crank turns at constant speed for any load; no actual motion is computed",
        examples=[True],
    )
    rotation: Literal["ccw", "cw"] = Field("ccw", description="sense of the crank", examples=["cw"])
    target_delta: Ratio | None = Field(None, description="target coefficient of speed fluctuation δ", examples=[0.02])
    fixed: dict[Name, Annotated[tuple[Length, Length], Pair]] = Field(
        description="points of the frame, [x, y]", examples=[{"F": ["570 mm", "580 mm"]}]
    )
    links: dict[Name, Link] = Field(description="the links by name")
    flywheel: Flywheel = Field(Flywheel(), description="the flywheel on the crankshaft")
    motor: Motor | None = Field(None, description="the motor; default: the torque that balances the cycle")
    friction: FrictionTable | None = Field(None, description="friction in all joints; default: none")
    joints: dict[JointName, JointTable] = Field(
        {},
        description='friction in one joint: a pin by its point, a guide by its block, "slider.guide"',
        examples=[{"B": {"coefficient": 0.1, "radius": "20 mm"}}],
    )
    groups: list[Group] = Field([], description="crank and structural groups in their order of attachment")
    branch: Branch = BRANCH
    drive: Drive | None = Field(None, description="the drive, in a scene without groups")
    slots: list[Slot] = Field([], description="the sliding joints, in a scene without groups")
    gears: list[GearPair] = Field([], description="gear pairs, in a scene without groups")
    racks: list[RackPair] = Field([], description="racks and their gears, in a scene without groups")
    sketch: dict[Name, Annotated[tuple[Length, Length], Pair]] = Field(
        {},
        description="approximate positions of moving pins at crank angle zero",
        examples=[{"C": ["300 mm", "250 mm"]}],
    )
    loads: list[Load] = Field([], description="the working loads")
    optimise: Optimise | None = Field(None, description="the optimisation problem")
