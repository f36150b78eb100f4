"""Windows of loads that are given by what happens: `window = { point = "D", last = "8 mm", going = "-" }`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from linkjax import loads
from linkjax.loads import Passage
from linkjax.mechanism import StructureError
from linkjax.scenes._fields import Angle, Length, Name, Pair, Quantity, Table, amount, wrong

AXES = {"x": "0 deg", "y": "90 deg"}
Part = Annotated[float, Quantity("length", "positive", "a part of the way is positive; `going` gives its sense")]
Swing = Annotated[float, Quantity("angle", "positive", "a part of the way is positive; `going` gives its sense")]
Direction = Annotated[
    float, Quantity("angle"), BeforeValidator(lambda value: AXES.get(value, value) if isinstance(value, str) else value)
]


class PointWindow(Table):
    """A window by the position of a point: the first or last part of each of its ways, between two positions, or whole
    ways in one sense."""

    point: Name = Field(description="the point whose position matters", examples=["D"])
    first: Part | None = Field(None, description="length of its way after a dead centre", examples=["8 mm"])
    last: Part | None = Field(None, description="length of its way before a dead centre", examples=["8 mm"])
    between: Annotated[tuple[Length, Length], Pair] | None = Field(
        None, description="two positions, the lower first", examples=[["10 mm", "50 mm"]]
    )
    going: Literal["+", "-"] | None = Field(
        None, description="only while the position increases (+) or decreases (-)", examples=["+"]
    )
    direction: Direction | None = Field(
        None, description="direction of the position: x, y or an angle; default: the guide's", examples=["x"]
    )


class OfLink(Table):
    """Keys about a link, in the place of a point."""

    @model_validator(mode="before")
    @classmethod
    def _one_element(cls, value: Any) -> Any:
        if isinstance(value, dict) and "point" in value:
            raise wrong("names both a point and a link", "name one point or one link")
        return value


class LinkWindow(OfLink):
    """A window by the angle of a link: the first or last part of each of its ways, between two angles, or whole ways in
    one sense."""

    link: Name = Field(description="the link whose angle matters", examples=["rocker"])
    first: Swing | None = Field(None, description="angle of its way after a limit position", examples=["5 deg"])
    last: Swing | None = Field(None, description="angle of its way before a limit position", examples=["5 deg"])
    between: Annotated[tuple[Angle, Angle], Pair] | None = Field(
        None, description="two angles, the lower first", examples=[["40 deg", "70 deg"]]
    )
    going: Literal["ccw", "cw"] | None = Field(
        None, description="only while it rotates counter-clockwise or clockwise", examples=["ccw"]
    )


def element(value: Any) -> str:
    """Which branch a table about a link or a point takes; that of the crank angle if it is no table."""
    if isinstance(value, dict):
        return "#link" if "link" in value else "#point"
    return "#crank"


Window = Annotated[
    Annotated[tuple[Angle, Angle], Pair, Tag("#crank")]
    | Annotated[PointWindow, Tag("#point")]
    | Annotated[LinkWindow, Tag("#link")],
    Discriminator(element),
]


def passage(table: PointWindow | LinkWindow) -> Passage:
    """The window of a table. Raises `ValueError` if its keys contradict each other."""
    return Passage(**{key: value for key, value in table.model_dump().items() if value is not None})


def window_keys(load: str, window: loads.Window | Passage) -> Any:
    """The window of a load as written in a scene file. Raises `StructureError` for several ranges of crank angle."""
    if isinstance(window, Passage):
        table: dict[str, Any] = {"point": window.point} if window.point else {"link": window.link}
        for key in ("first", "last"):
            if getattr(window, key) is not None:
                table[key] = amount(getattr(window, key), window.unit)
        if window.between is not None:
            table["between"] = [amount(value, window.unit) for value in window.between]
        table |= {"going": window.going} if window.going else {}
        return table if window.direction is None else {**table, "direction": amount(window.direction, "rad")}
    if window.on.ndim:
        raise StructureError(load, "scene files do not support a window of several ranges of crank angle",
                             "write the window from which they were found, or several loads")  # fmt: skip
    return [amount(window.on, "rad"), amount(window.off, "rad")]
