"""The elements by name: what each of them takes, and its results as a document."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from linkjax.elements._sliding import incline, screw, slider, wedge_press
from linkjax.elements._turning import gripping_cam, journal, thrust_ring

EFFORT = {"friction": ("number", "coefficient of friction"), "load": ("force", "load")}


class Named(NamedTuple):
    """An element by name: its function, its `inputs` {name: (dimension, meaning)}, the `needed` ones, the unit of its
    effort, and what its two directions of motion are called."""

    title: str
    function: Callable[..., Any]
    inputs: dict[str, tuple[str, str]]
    needed: tuple[str, ...]
    unit: str
    ways: tuple[str, ...] = ()


NAMED = {
    "slider": Named(
        "Slider under a force at an angle", slider,
        {"angle": ("angle", "angle between force and normal"), **EFFORT}, ("angle",), "N",
        ("pushed", "moved back by the load"),
    ),
    "incline": Named(
        "Incline", incline, {"angle": ("angle", "angle of the incline"), **EFFORT}, ("angle",), "N", ("up", "down")
    ),
    "screw": Named(
        "Screw", screw,
        {"diameter": ("length", "mean diameter"), "lead": ("length", "lead: pitch times starts"),
         "flank": ("angle", "half the angle of the thread"), **EFFORT},
        ("diameter", "lead"), "N m", ("against the load", "with the load"),
    ),
    "wedge-press": Named(
        "Wedge press", wedge_press, {"angle": ("angle", "angle of the wedge"), **EFFORT}, ("angle",), "N",
        ("pressing", "released"),
    ),
    "gripping-cam": Named(
        "Gripping cam", gripping_cam,
        {"eccentricity": ("length", "from the pivot to the centre"), "radius": ("length", "radius of the disc"),
         "angle": ("angle", "angle between eccentricity and normal"),
         "pivot": ("length", "radius of the friction circle at the pivot"), **EFFORT},
        ("eccentricity", "radius", "angle"), "N m", ("gripping", "opening"),
    ),
    "journal": Named(
        "Journal", journal,
        {"radius": ("length", "radius of the journal"), "distance": ("length", "distance of the force from the axis"),
         **EFFORT},
        ("radius",), "N m",
    ),
    "thrust-ring": Named(
        "Thrust ring", thrust_ring,
        {"outer": ("length", "outer radius"), "inner": ("length", "inner radius"), **EFFORT}, ("outer",), "N m",
    ),
}  # fmt: skip


def element_document(name: str, given: Mapping[str, Any], bearing: str | None = None) -> dict[str, Any]:
    """The results of an element as plain numbers (SI): `element`, `title`, `given`, and `forward` and `backward` with
    `effort`, `efficiency`, `limit`, `margin` and `locks`, or the numbers of a journal or thrust ring.

    `given` are the numbers that its function takes. Raises `ValueError` for an unknown element, an input that it does
    not have or that is missing, and as its function does.
    """
    if name not in NAMED:
        close = difflib.get_close_matches(name, NAMED, 1)
        remedy = f"did you mean {close[0]!r}?" if close else f"write one of {', '.join(NAMED)}"
        raise ValueError(f"there is no element {name!r}; {remedy}")
    known, extra = NAMED[name], {} if bearing is None else {"bearing": bearing}
    if unknown := [key for key in given if key not in known.inputs]:
        raise ValueError(f"{name} has no {unknown[0]}; it takes {', '.join(known.inputs)}")
    if missing := [key for key in (*known.needed, "friction") if key not in given]:
        raise ValueError(f"{name} needs its {missing[0]} ({known.inputs[missing[0]][1]})")
    if extra and known.ways:
        raise ValueError(f"{name} has no bearing; only journal and thrust-ring have one")
    found = known.function(**given, **extra)
    data: dict[str, Any] = {"element": name, "title": known.title, "given": {**given, **extra}}
    if not known.ways:
        return {**data, **{key: _plain(value) for key, value in found._asdict().items() if np.isfinite(value)}}
    for key in ("forward", "backward"):
        way = getattr(found, key)
        parts: dict[str, Any] = {part: _plain(value) for part, value in way._asdict().items()}
        data[key] = {**parts, "locks": bool(way.margin <= 0)}
    return {**data, "friction_angle": float(found.friction_angle)}


def _plain(value: Any) -> float | None:
    """A number for JSON; None where no finite one exists."""
    return float(value) if np.isfinite(value) else None
