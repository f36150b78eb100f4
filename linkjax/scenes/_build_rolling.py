"""From a raw document to a machine of rolling bodies."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from linkjax._display import Numbers
from linkjax.rolling import (
    Rolling,
    RollingMachine,
    closing_eccentricity,
    closing_inner_radius,
    closing_outer_radius,
    margins,
)
from linkjax.scenes._document import ROLLING, Document, load_document, overridden, titled
from linkjax.scenes._errors import SceneError
from linkjax.scenes._explain import explained, fault
from linkjax.scenes._fields import amount
from linkjax.scenes._located import located
from linkjax.scenes._rolling import RollingFile

SIZES = ("inner_radius", "outer_radius", "eccentricity")


def load_rolling(name_or_path: str | os.PathLike[str], changes: Mapping[str, Any] | None = None) -> RollingMachine:
    """Load a built-in machine of rolling bodies by name ("rolling-eccentric") or from a file, with single keys changed.

    `changes` maps keys to values, e.g. `{"eccentricity": "8 mm"}`. Raises `SceneError`, with file, key, value and
    remedy, when the file is missing, is a linkage, or anything in it is wrong. Where both radii and the eccentricity
    are given, `linkjax.rolling.check` checks whether the chain closes.
    """
    return build_rolling(overridden(load_document(name_or_path), changes))


def build_rolling(document: Document) -> RollingMachine:
    """The rolling bodies of a raw document. Raises `SceneError` for the first error in it."""
    source, table = document.source, document.table
    if not document.rolling:
        raise SceneError(
            source, "kind", table.get("kind"), "not a scene of rolling bodies", "load a linkage with linkjax.load"
        )
    with located(source, table):
        model = explained(RollingFile, source, table)
        design = _design(model, document)
        speed = model.speed if model.rotation == "ccw" else -model.speed
        return RollingMachine(design, model.held, model.driven, speed, model.title)


def _design(model: RollingFile, document: Document) -> Rolling:
    """The design, with the omitted size computed."""
    inner, outer, e, bodies, turns = (getattr(model, key) for key in (*SIZES, "bodies", "turns"))
    missing = [key for key in SIZES if getattr(model, key) is None]
    if len(missing) > 1:
        problem = f"missing, like {missing[1]}: only one of {', '.join(SIZES)} can be computed"
        raise fault(document.source, document.table, (missing[0],), problem, f"add {missing[0]} or {missing[1]}")
    if outer is None:
        outer = closing_outer_radius(inner, bodies, e, turns)
    elif inner is None:
        inner = closing_inner_radius(outer, bodies, e, turns)
        if float(inner) <= 0:
            problem = "no inner ring closes the chain: the eccentricity reaches the outer radius"
            raise fault(document.source, document.table, ("eccentricity",), problem, "write a smaller one")
    elif e is None:
        e = closing_eccentricity(inner, outer, bodies, turns)
        if float(margins(Rolling(inner, outer, bodies, turns)).closing) < 0:
            least = Numbers().quantity(float(closing_outer_radius(inner, bodies, 0.0, turns)), "m", 9)
            problem = f"no eccentricity closes the chain: the inner ring is too large for {bodies} bodies"
            remedy = f"write an outer radius of {least} at least, or more bodies"
            raise fault(document.source, document.table, ("outer_radius",), problem, remedy)
    return Rolling(inner, outer, bodies, turns, e, model.start)


def rolling_text(machine: RollingMachine, comment: str = "") -> str:
    """The scene file of a machine as a string, in SI units, below a comment; reading it gives the same machine.

    Raises `StructureError` for a machine that is traced or batched.
    """
    import tomli_w  # imported only when a file is written

    design = machine.design
    head = "".join(f"# {line}".rstrip() + "\n" for line in comment.splitlines())
    return head + tomli_w.dumps({
        "kind": "rolling", **({"title": machine.title} if machine.title else {}),
        **{key: amount(getattr(design, key), "m") for key in SIZES},
        "bodies": design.bodies, "turns": design.turns, "start": amount(design.start, "rad"),
        "held": machine.held, "driven": machine.driven, "speed": amount(abs(machine.speed), "rad/s"),
        "rotation": "cw" if float(machine.speed) < 0 else "ccw",
    }, multiline_strings=False)  # fmt: skip


def rolling_starter(name: str) -> str:
    """A commented starter scene of rolling bodies as a string: what `linkjax new NAME --kind rolling` writes."""
    return (ROLLING / "starter.txt").read_text(encoding="utf-8").replace("NAME", titled(name))


def rolling_schema() -> dict[str, Any]:
    """JSON Schema of a scene file of rolling bodies."""
    return RollingFile.model_json_schema(by_alias=True)
