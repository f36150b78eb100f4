"""Families of measures: statistic, quantity and regime before the dot, the element behind it, as in `stroke.D`.

A name is `[statistic_]quantity[_constant_speed][.element]`, with `@60deg` for the value at a crank angle, or with
`where 90deg to 180deg` for an extreme in a window of crank angle.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from jaxtyping import Array

from linkjax._numerics import smallest
from linkjax._units import in_si
from linkjax.machine import Scene
from linkjax.measures._friction import efficiency, efficiency_at, loss, no_friction, not_useful, rubbing_joints
from linkjax.measures._gaps import limited_groups, margins, transmission_angles
from linkjax.measures._inertia import RATIO
from linkjax.measures._parts import Parts
from linkjax.measures._quantities import QUANTITIES, Quantity, turning_groups
from linkjax.measures._starting import run_up, torque_margin
from linkjax.measures._strokes import resting, stopping, stroke_rows, swing_rows, time_ratio, time_ratios
from linkjax.measures._structure import Elements
from linkjax.motion import Rows, Wanted
from linkjax.runs import no_start

CONSTANT = "_constant_speed"
# the statistics of each quantity
STATISTICS: dict[str, tuple[str, ...]] = {
    "x": ("min", "max"),
    "y": ("min", "max"),
    "travel": ("min", "max"),
    "angle": ("min", "max"),
    "velocity": ("max", "rms"),
    "acceleration": ("peak", "rms"),
    "angular_velocity": ("peak", "max", "min", "rms"),
    "angular_acceleration": ("peak", "max", "min", "rms"),
    "reaction": ("peak", "max", "min", "rms"),
    "shaking_force": ("peak", "rms"),
    "shaking_moment": ("peak", "max", "min", "rms"),
    "frame_force": ("peak", "rms"),
    "net_frame_force": ("peak", "rms"),
    "drive_torque": ("peak", "max", "min", "rms"),
    "drive_power": ("peak", "max", "min"),
    "motor_speed": ("peak", "max", "min"),
    "motor_torque": ("peak", "max", "min", "rms", "mean"),
    "motor_power": ("peak", "max", "min", "mean"),
    "crank_speed": ("min", "max"),
    "transmission_angle": (),
}
SAID = {
    "peak": "Largest magnitude",
    "max": "Largest value",
    "min": "Smallest value",
    "rms": "Root mean square over time",
    "mean": "Mean over time",
}


class Asked(NamedTuple):
    """A name taken apart: the family, its element ("" for none), and a crank angle, or a window of it (rad)."""

    family: str
    element: str
    angle: float | None = None
    window: tuple[float, float] | None = None

    def text(self) -> str:
        """The name."""
        found = f"{self.family}.{self.element}" if self.element else self.family
        if self.angle is not None:
            return f"{found}@{degrees_text(self.angle)}"
        return found if self.window is None else f"{found} where {' to '.join(map(degrees_text, self.window))}"


@dataclasses.dataclass(frozen=True)
class Family:
    """Measures of one kind, of different elements: the name before the dot, the SI unit, the meaning, what the element
    is ("point", "link", "group", "joint", "" for none), and its names in a scene. `motion` says whether the actual
    motion is needed; `quantity` and `statistic` what it is an extreme of. `at` gives the value for a crank angle (rad),
    `lacks` what a scene lacks for it. With `inverse` it is one over the extreme of the quantity."""

    name: str
    unit: str
    meaning: str
    of: str
    names: Callable[[Scene], Elements]
    motion: bool
    quantity: Quantity | None = None
    statistic: str = ""
    value: Callable[[Parts, str], Array] | None = None
    rows: Callable[[Parts, str], Rows | Wanted] | None = None
    at: Callable[[Parts, float], Array] | None = None
    lacks: Callable[[Scene], tuple[str, str] | None] | None = None
    inverse: bool = False

    def lacking(self, scene: Scene) -> tuple[str, str] | None:
        """What a scene lacks for it, and a remedy; None if it has it."""
        if self.lacks is not None:
            return self.lacks(scene)
        return None if self.quantity is None else self.quantity.lacking(scene)

    @property
    def smallest(self) -> bool:
        """Whether it is the smallest of its rows."""
        return (self.statistic == "min") is not self.inverse


FAMILIES: dict[str, Family] = {}


def _families(quantity: Quantity) -> None:
    """Register the families of a quantity."""
    for constant in (False, True) if quantity.moves and quantity.name != "crank_speed" else (False,):
        motion = quantity.moves and not constant
        how = "" if not quantity.moves else " in the actual motion" if motion else " at constant nominal speed"
        for statistic in ("", *STATISTICS[quantity.name]):
            name = f"{statistic}_{quantity.name}".lstrip("_") + CONSTANT * constant
            what = quantity.meaning.rstrip(".")
            meaning = f"{SAID[statistic]} of the {what[0].lower()}{what[1:]}{how}." if statistic else f"{what}{how}."
            FAMILIES[name] = Family(
                name, quantity.unit, meaning, quantity.of, quantity.names, motion, quantity, statistic
            )


for _name in STATISTICS:
    _families(QUANTITIES[_name])


def _own(name: str, unit: str, of: str, names: Callable[[Scene], Elements], meaning: str, **given: Any) -> None:
    FAMILIES[name] = Family(name, unit, meaning, of, names, **{"motion": False, **given})


_own(
    "stroke", "m", "point", QUANTITIES["travel"].names,
    "Distance between the outermost positions of a point of a slider along its guide.", rows=stroke_rows,
)  # fmt: skip
_own(
    "swing", "rad", "link", QUANTITIES["angle"].names,
    "Angle between the outermost positions of a link; of a link that turns fully, its whole turns.", rows=swing_rows,
)  # fmt: skip
_own(
    "time_ratio", "1", "point or link", stopping,
    "Time of the slower way of a slider or link to that of the faster one, back, at constant crank speed; infinite "
    "where it never turns back; none where a motion law has dwells.", value=time_ratio, rows=time_ratios,
    lacks=resting,
)  # fmt: skip
_own("path_length", "m", "point", QUANTITIES["velocity"].names, "Length of the path of a point over the cycle.")
_own(
    "min_margin", "1", "group", limited_groups,
    "Smallest signed assembly margin of a group over the continuous cycle; negative: cannot be assembled.",
    value=lambda of, group: smallest(margins(of, group).size()), rows=margins, statistic="min",
)  # fmt: skip
_own(
    "min_transmission_angle", "rad", "group", turning_groups,
    "Smallest transmission angle of a group over the cycle, where an obtuse angle counts as its supplement.",
    rows=transmission_angles, statistic="min",
)  # fmt: skip
_own(
    RATIO, "1", "", QUANTITIES["crank_speed"].names,
    "Largest joint force by inertia alone, divided by the largest by weight and loads alone, at constant nominal "
    "speed; above 0.1 statics alone is not sufficient; infinite where weight and loads give no force.",
)  # fmt: skip
_own(
    "run_up_time", "s", "", lambda scene: (),
    "Time from rest, at crank angle zero or at the one given (`run_up_time@60deg`), to 99 % of the speed of the "
    "steady-state motion at the same crank angle; infinite if the machine does not get there.", motion=True,
    value=lambda of, element: run_up(of), at=run_up, lacks=no_start,
)  # fmt: skip
_own(
    "starting_torque_margin", "1", "", lambda scene: (),
    "Torque of the motor at rest, on the crank, over the greatest static load torque over the cycle, less 1; negative: "
    "does not start from there; infinite if no load resists.", value=torque_margin, lacks=no_start,
)  # fmt: skip
for _motion in (True, False):
    _how = "in the actual motion" if _motion else "at constant nominal speed"
    _suffix = "" if _motion else CONSTANT
    _own(
        f"loss{_suffix}", "J", "joint", rubbing_joints, f"Work per cycle that the friction of a joint takes, {_how}.",
        value=functools.partial(loss, motion=_motion), motion=_motion, lacks=no_friction,
    )  # fmt: skip
    _own(
        f"efficiency{_suffix}", "1", "", lambda scene: (),
        f"Work on the useful loads over the net work of the drive, per cycle, {_how}; at a crank angle the drive "
        "torque without friction over that with it.", motion=_motion, lacks=not_useful,
        value=lambda of, element, motion=_motion: efficiency(of, motion),
        at=functools.partial(efficiency_at, motion=_motion),
    )  # fmt: skip
_own(
    "locking_factor", "1", "", lambda scene: (),
    "Least common factor of all friction at which the machine locks at a crank angle, quasi-static: no finite drive "
    "torque moves it; infinite if it is above 1000.",
    quantity=QUANTITIES["locking"], statistic="max", inverse=True, lacks=no_friction,
)  # fmt: skip


@functools.cache
def degrees_text(angle: float) -> str:
    """A crank angle as it is written in names, so that it is read back exactly."""
    text = f"{math.degrees(angle):.12g}deg"
    return text if float(in_si(text)[0]) == angle else f"{angle!r}rad"
