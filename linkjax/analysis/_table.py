"""The columns of a cycle, one row a crank angle: what `Cycle.table` and the CSV files hold.

A column has the name of its quantity, then of what it belongs to, with underscores between: `dx_B` is `points.B.dx` of
the JSON document. Names are words of letters, figures and underscores, so that `numpy.genfromtxt(names=True)` keeps
them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from linkjax._results import Result
from linkjax.analysis._document import document
from linkjax.analysis._tidy import CONSTANT
from linkjax.mechanism import StructureError

ANGLE = "crank_angle"
KINDS = ("points", "links", "groups", "reduced", "motion", "motor", "loads", "friction", "forces",
         "forces_constant_speed")  # fmt: skip
TURNED = {"angle": "angle", "d": "dangle", "dd": "ddangle"}  # of links

Columns = dict[str, np.ndarray]


def table_of(cycle: Any) -> Columns:
    """All columns of a cycle; see `Cycle.table`."""
    if np.ndim(cycle.result) or np.ndim(cycle.angles) != 1:
        problem = f"the cycle is a batch of {np.size(cycle.result)}"
        raise ValueError(f"{problem}, but a table holds one; take one, e.g. jax.tree.map(lambda leaf: leaf[0], cycle)")
    kinds = columns(document(cycle)).values()
    return {name: np.array(column) for kind in kinds for name, column in kind.items()}


def columns(data: dict[str, Any]) -> dict[str, Columns]:
    """Columns of a document by kind, the crank angle (rad) first; of a kind that has none there is no entry. Where the
    machine cannot be assembled all but the angle are NaN.

    Raises `StructureError` where two columns have the same name, as those of points `a-b` and `a_b`.
    """
    apart = np.asarray(data["result"]["per_angle"]) != Result.SUCCESS
    found: dict[str, Columns] = {}
    taken: dict[str, str] = {}
    for kind in KINDS:
        named: Columns = {}
        for path, values in _series(data.get(kind) or {}, len(data["angles"])):
            name, where = _name(kind, path), ".".join((kind, *path))
            if name in taken:
                problem = f"has the column name {name!r}, as {taken[name]} has"
                raise StructureError(where, problem, "rename one of the points, links or loads")
            taken[name], named[name] = where, np.where(apart, np.nan, values) if apart.any() else values
        if named:
            found[kind] = {ANGLE: data["angles"], **named}
    return found


def _name(kind: str, path: tuple[str, ...]) -> str:
    """The name of a column, from its place in the document."""
    *owners, key = path
    if kind == "links":
        key = TURNED[key]
    elif kind == "motor":
        key = f"motor_{key}"
    elif kind == "loads" and key != "power":
        key = f"{key}_load"
    elif kind == "friction":
        key = f"friction_{key}" if owners or key == "efficiency" else key
        owners = owners[1:]
    elif owners[:1] == ["torque_by_load"]:
        owners, key = [key], "torque"
    elif owners[:1] == ["reactions"]:
        owners = owners[1:]
    name = re.sub(r"\W", "_", "_".join([key, *owners]))
    return f"{name}{CONSTANT}" if kind.endswith(CONSTANT) else name


def _series(tree: dict[str, Any], length: int, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _series(value, length, (*path, key))
        elif getattr(value, "shape", ()) == (length,):
            yield (*path, key), value
