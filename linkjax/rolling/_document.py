"""JSON document of a chain of rolling bodies, the input of tables, figures and the report."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._compile import compiled_soon
from linkjax._results import Result
from linkjax._types import Scalar
from linkjax._vec import Vec
from linkjax.rolling._chain import Chain, Ellipse, centre_curve, chain, clearances, closing_clearance
from linkjax.rolling._design import Rolling
from linkjax.rolling._machine import Closing, RollingMachine, closing, problem
from linkjax.rolling._rates import Rates

ROUNDING = 1e-14  # relative to the outer radius


class _Computed(NamedTuple):
    """Computed quantities of a chain and its motion; `path` and `turned` over the angles of the driven member."""

    made: Chain
    curve: Ellipse
    clearance: Scalar
    apart: Array
    speeds: Rates
    ratios: Rates
    angles: Array
    path: Chain
    turned: Rates


@functools.partial(compiled_soon, static=("angles",))
def _computed(machine: RollingMachine, angles: int) -> _Computed:
    design, steps = machine.design, jnp.linspace(0.0, machine.cycle, angles, endpoint=False)
    along = steps * jnp.where(machine.speed < 0, -1.0, 1.0)
    return _Computed(
        chain(design), centre_curve(design), closing_clearance(design), clearances(design), machine.speeds(),
        machine.turned(1.0), steps, jax.vmap(machine.at)(along), jax.vmap(machine.turned)(along),
    )  # fmt: skip


def document(machine: RollingMachine, angles: int = 360, name: str = "", version: str = "") -> dict[str, Any]:
    """The machine as nested dicts of NumPy arrays and floats (SI); see `docs/rolling.md` for the layout.

    The positions of the bodies are given at `angles` equal steps of the driven member, along its rotation: over one
    turn of the line of centres, or of the driven member if the line of centres is held.
    """
    design, found, judged = machine.design, _computed(machine, angles=angles), closing(machine.design)
    made, path, turned = found.made, found.path, found.turned
    wrong = problem(design)
    code = Result.CANNOT_BE_ASSEMBLED if wrong else Result.SUCCESS
    data = {
        "scene": name or machine.title,
        "title": machine.title,
        "kind": "rolling",
        "linkjax_version": version,
        "precision": str(made.radii.dtype),
        "rings": {
            "inner_radius": design.inner_radius, "outer_radius": design.outer_radius,
            "eccentricity": design.eccentricity,
        },
        "chain": {
            "bodies": design.bodies, "turns": design.turns, "start": design.start,
            "closure_gap": judged.gap, "closing_clearance": found.clearance,
        },
        "bodies": {"angle": made.angles, "radius": made.radii, **_both(made.centres)},
        "contacts": {kind: _both(getattr(made, f"{kind}_contacts")) for kind in ("inner", "outer", "neighbour")},
        "centres": {**_both(found.curve.centre), "semi_major": found.curve.major, "semi_minor": found.curve.minor},
        "limits": _limits(design, found, judged),
        "motion": {
            "held": machine.held, "driven": machine.driven, "speed": machine.speed,
            **_rates(found.speeds), "rubbing": found.speeds.rubbing, "ratios": _rates(found.ratios),
        },
        "angles": found.angles,
        "path": {
            "x": path.centres.x.T, "y": path.centres.y.T, "body_angles": turned.bodies.T,
            "inner": {**_both(path.inner_centre), "angle": turned.inner},
            "outer": {**_both(path.outer_centre), "angle": turned.outer},
            "carrier": turned.carrier,
        },
        "checks": {"contacts": _contacts(design, made)},
        "result": {"code": int(code), "name": code.name.lower(), "message": wrong or "The chain closes."},
    }  # fmt: skip
    return _plain(data)


def tidy(data: dict[str, Any]) -> dict[str, Any]:
    """The document for display: positions of the bodies and the gap are zero if they are only rounding errors."""
    least = ROUNDING * data["rings"]["outer_radius"]
    bodies, chain = data["bodies"], data["chain"]
    places = {key: np.where(np.abs(bodies[key]) < least, 0.0, bodies[key]) for key in ("x", "y")}
    gap = chain["closing_clearance"]
    return data | {"bodies": bodies | places, "chain": chain | {"closing_clearance": 0.0 if abs(gap) < least else gap}}


def _plain(value: Any) -> Any:
    """JAX arrays as NumPy arrays, scalars as Python floats."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, jax.Array):
        value = np.asarray(value)
        return float(value) if value.ndim == 0 else value
    return value


def _both(at: Vec) -> dict[str, Any]:
    return {"x": at.x, "y": at.y}


def _rates(rates: Rates) -> dict[str, Any]:
    return {key: getattr(rates, key) for key in ("inner", "outer", "carrier", "bodies")}


def _limits(design: Rolling, found: _Computed, judged: Closing) -> dict[str, Any]:
    """Bounds and margins of the chain, and the values that would close it."""
    inner, outer, e = (float(x) for x in (design.inner_radius, design.outer_radius, design.eccentricity))
    return {
        "max_radius": 0.5 * (outer + abs(e) - inner), "min_radius": 0.5 * (outer - abs(e) - inner),
        "ring_margin": judged.margins.rings, "closing_margin": judged.margins.closing,
        "closing_outer_radius": judged.outer_radius,
        "closing_eccentricity": judged.eccentricity if float(judged.margins.closing) >= 0 else None,
        "fitting_bodies": judged.bodies,
        "min_clearance": float(jnp.min(found.apart)) if found.apart.size else None,
    }  # fmt: skip


def _contacts(design: Rolling, made: Chain) -> float:
    """Largest gap or overlap of surfaces that should touch, over the outer radius, computed from the centres."""
    x, y, r = (np.asarray(part) for part in (made.centres.x, made.centres.y, made.radii))
    inner, outer, e = (float(each) for each in (design.inner_radius, design.outer_radius, design.eccentricity))
    gaps = [np.hypot(x, y) - (inner + r), np.hypot(x - e, y) - (outer - r)]
    gaps.append(np.hypot(np.diff(x, append=x[0]), np.diff(y, append=y[0])) - (r + np.roll(r, -1)))
    return float(max(np.max(np.abs(gap)) for gap in gaps)) / outer if outer > 0 else math.nan
