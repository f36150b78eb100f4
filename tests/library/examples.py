# pyright: reportArgumentType=false
"""One design of every machine of the library, with masses and loads."""

from __future__ import annotations

import math
from collections.abc import Callable

import linkjax as lj
from linkjax import Force, Link, Mechanism, Vec


def heavy(*names: str) -> dict[str, Link]:
    """Bars and blocks with masses, inertias, and mass centres off their axes."""
    return {
        name: Link(mass=1.0 + 0.3 * i, inertia=0.004 + 0.001 * i, centre=Vec(0.05 + 0.01 * i, 0.02))
        for i, name in enumerate(names)
    }


FOUR = ("crank", "coupler", "rocker")
SIX = (*FOUR, "rod", "lever")
MADE: dict[str, Callable[[], Mechanism]] = {
    "four_bar": lambda: lj.four_bar(0.1, 0.35, 0.25, 0.38, links=heavy(*FOUR), flywheel=0.5),
    "slider_crank": lambda: lj.slider_crank(0.04, 0.17, 0.008, links=heavy("crank", "rod", "slider"), flywheel=0.3),
    "scotch_yoke": lambda: lj.scotch_yoke(0.08, links=heavy("crank", "yoke", "die"), flywheel=1.0),
    "quick_return": lambda: lj.quick_return(
        0.12, 0.35, 0.75, 0.26, 0.39, links=heavy("crank", "lever", "die", "rod", "ram"), flywheel=5.0
    ),
    "whitworth": lambda: lj.quick_return(
        0.2, 0.08, 0.15, 0.5, 0.02, side=1, links=heavy("crank", "lever", "die", "rod", "ram"), flywheel=5.0
    ),
    "toggle_press": lambda: lj.toggle_press(
        0.06, 0.4, 0.3, 0.32, (0.35, 0.3), links=heavy("crank", "rod", "upper", "lower", "ram"), flywheel=1.0
    ),
    "watt-1": lambda: lj.six_bar(
        "watt-1", 0.1, 0.35, 0.25, 0.38, 0.3, 0.28, (0.2, 0.14), (0.3, -0.06), links=heavy(*SIX), flywheel=0.5
    ),
    "watt-2": lambda: lj.six_bar(
        "watt-2", 0.1, 0.35, 0.25, 0.38, 0.5, 0.3, (0.2, -0.1), (0.75, 0.1), links=heavy(*SIX), flywheel=0.5
    ),
    "stephenson-1": lambda: lj.six_bar(
        "stephenson-1", 0.1, 0.35, 0.25, 0.38, 0.4, 0.3, (0.05, 0.06), (0.1, -0.1), links=heavy(*SIX), rotation="cw",
        flywheel=0.5,
    ),
    "stephenson-3": lambda: lj.six_bar(
        "stephenson-3", 0.1, 0.35, 0.25, 0.38, 0.3, 0.26, (0.2, 0.14), (0.45, 0.4), second_side=-1, links=heavy(*SIX),
        flywheel=0.5,
    ),
    "scissor_lift": lambda: lj.scissor_lift(
        2.94, 0.5, math.radians(11.2), math.radians(45.0), links={**heavy("bar", "other"), "rod": Link(mass=30.0)}
    ),
}  # fmt: skip
LOADED = {"scotch_yoke": ("yoke", "E"), "scissor_lift": ("bar", "T")}


def scene(name: str) -> lj.Scene:
    """A machine with a constant force on one of its points."""
    mechanism = MADE[name]()
    link, point = LOADED.get(name, (mechanism.link_names[-1], mechanism.links[mechanism.link_names[-1]].centre_name))
    loads = (Force("work", link, point, force=Vec(20.0, -50.0)),)
    return lj.Scene(mechanism, loads, Vec(0.0, -9.81), speed=0.5 if name == "scissor_lift" else 12.0, title=name)
