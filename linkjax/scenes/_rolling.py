"""The format of a scene file of rolling bodies, `kind = "rolling"`, as a pydantic model.

Rolling bodies are a separate kind of scene, not a kind of group: their file has its own model, loader and page. They
share with linkages the reading of files and units, the style of figures, and one branch in each command.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PlainValidator, WithJsonSchema

from linkjax.scenes._fields import Angle, Quantity, Speed, Table, Turns, wrong


def _bodies(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 3 <= value <= 1000:
        raise wrong("not an integer from 3 to 1000", "write the number of bodies between the rings, e.g. 8")
    return value


Bodies = Annotated[int, PlainValidator(_bodies), WithJsonSchema({"type": "integer", "minimum": 3, "maximum": 1000})]
Radius = Annotated[float, Quantity("length", "positive")]
Offset = Annotated[
    float, Quantity("length", "zero", "write the distance; `start` gives the position of the first body")
]
Member = Literal["inner", "outer", "carrier"]


class RollingFile(Table):
    """Rolling bodies between two rings. A radius or the eccentricity that is omitted is computed to close the chain."""

    model_config = ConfigDict(
        title="linkjax scene of rolling bodies",
        json_schema_extra={"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": "linkjax-rolling"},
    )

    kind: Literal["rolling"] = Field(description="a chain of rolling bodies between two rings", examples=["rolling"])
    title: str = Field("", description="title for reports", examples=["Eccentric rolling mechanism"])
    inner_radius: Radius | None = Field(None, description="radius of the inner ring", examples=["40 mm"])
    outer_radius: Radius | None = Field(None, description="radius of the outer ring", examples=["90 mm"])
    eccentricity: Offset | None = Field(None, description="distance of the centres of the rings", examples=["5 mm"])
    bodies: Bodies = Field(description="number of rolling bodies", examples=[8])
    turns: Turns = Field(1, description="turns of the chain about the inner ring until it closes", examples=[2])
    start: Angle = Field(0.0, description="angle of the first body from the line of centres", examples=["20 deg"])
    held: Member = Field("outer", description="the fixed ring, or the fixed line of centres", examples=["carrier"])
    driven: Member = Field("inner", description="the driving ring, or the driving line of centres", examples=["outer"])
    speed: Speed = Field(description="speed of the driven member", examples=["300 rpm"])
    rotation: Literal["ccw", "cw"] = Field("ccw", description="sense of the driven member", examples=["cw"])
