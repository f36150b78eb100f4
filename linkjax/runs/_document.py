"""A run as a document of plain numbers, for JSON, tables and figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from linkjax.runs._transient import Transient


def run_document(found: Transient, scene: str = "", version: str = "") -> dict[str, Any]:
    """All results of a run as plain numbers in SI units; None where there is no finite number. `scene` is the name of
    its scene and `version` that of linkjax."""
    starting, energies = found.starting, found.energies
    courses = ("time", "angle", "speed", "acceleration", "motor_speed", "motor_torque", "motor_power")
    events = ("starts", "stopped", "stop_angle", "stop_time", "goes_back", "run_up_time", "run_down_time", "complete")
    data: dict[str, Any] = {"scene": scene, "linkjax": version}
    data |= {name: plain(getattr(found, name)) for name in (*courses, *events)}
    data["starting"] = None if starting is None else {name: plain(x) for name, x in starting._asdict().items()}
    if energies is not None:
        parts = {name: plain(x) for name, x in energies._asdict().items() if name != "loads"}
        data["energies"] = {**parts, "loads": {name: plain(x) for name, x in energies.loads.items()}}
    return data


def plain(value: Any) -> Any:
    """An array as plain numbers; None in the place of one that is not finite."""
    values = np.asarray(value)
    if values.ndim:
        return [plain(each) for each in values]
    if values.dtype == bool:
        return bool(values)
    return float(values) if np.isfinite(values) else None
