"""A machine of rolling bodies in plain text: what `print(machine)` and the command `show` show."""

from __future__ import annotations

from typing import Any

from linkjax._display import Numbers, aligned

MEMBER_NAMES = {"inner": "inner ring", "outer": "outer ring", "carrier": "line of centres"}


def structure_of(machine: Any) -> str:
    """The structure in words, in place of a structural formula."""
    design = machine.design
    turns = f" in {design.turns} turns" if design.turns > 1 else ""
    return f"{design.bodies} rolling bodies between two rings{turns}"


def rolling_rows(machine: Any, show: Numbers) -> list[tuple[str, str]]:
    """Rings, bodies and drive, by name."""
    design, driven, held = machine.design, MEMBER_NAMES[machine.driven], MEMBER_NAMES[machine.held]
    return [
        ("structure", structure_of(machine)),
        ("inner", show.quantity(float(design.inner_radius), "m", 9)),
        ("outer", show.quantity(float(design.outer_radius), "m", 9)),
        ("offset", f"{show.quantity(float(design.eccentricity), 'm', 9)} between the centres of the rings"),
        ("start", f"{show.bound(design.start, 'rad')} from the line of centres to the first body"),
        (
            "drive",
            f"{driven} at {show.bound(machine.speed, 'rad/s')}, {held} held",
        ),
    ]


def rolling_text(machine: Any) -> str:
    """Rings, bodies and drive; one line where the numbers are those of several designs, traced, or placeholders."""
    title = machine.title or "Rolling bodies"
    try:
        return "\n".join([title, *aligned(rolling_rows(machine, Numbers()))])
    except (AttributeError, TypeError, ValueError):  # what float() raises for these
        return f"{title}: {structure_of(machine)} (traced numbers, or several designs)"
