"""The JSON document of a chain of rolling bodies: what tables, figures and the report read."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from linkjax._results import Result
from linkjax._vec import Vec
from linkjax.rolling._chain import Chain, centre_curve, chain, clearances, closing_clearance, closure_gap
from linkjax.rolling._closing import closing_eccentricity, closing_outer_radius, fitting_bodies, margins
from linkjax.rolling._design import Rolling
from linkjax.rolling._machine import RollingMachine, problem


def document(machine: RollingMachine, angles: int = 360, name: str = "", version: str = "") -> dict[str, Any]:
    """The machine as nested dicts of NumPy arrays and floats (SI), laid out as `docs/rolling.md` says.

    `angles` is the number of equal steps of the driven member, along its rotation, at which the places of the bodies
    are given: over one turn of the line of centres, or of the driven member where the line of centres is held.
    """
    design, made, speeds, ratios = machine.design, chain(machine.design), machine.speeds(), machine.turned(1.0)
    turned = jnp.linspace(0.0, machine.cycle, angles, endpoint=False)
    along = turned * jnp.where(machine.speed < 0, -1.0, 1.0)
    path, spins = jax.vmap(machine.at)(along), jax.vmap(machine.turned)(along)
    wrong = problem(design)
    code = Result.CANNOT_BE_ASSEMBLED if wrong else Result.SUCCESS
    found = {
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
            "closure_gap": closure_gap(design), "closing_clearance": closing_clearance(design),
        },
        "bodies": {"angle": made.angles, "radius": made.radii, "x": made.centres.x, "y": made.centres.y},
        "contacts": {
            kind: _both(getattr(made, f"{kind}_contacts")) for kind in ("inner", "outer", "neighbour")
        },
        "centres": _curve(design),
        "limits": _limits(design),
        "motion": {
            "held": machine.held, "driven": machine.driven, "speed": machine.speed,
            "inner": speeds.inner, "outer": speeds.outer, "carrier": speeds.carrier, "bodies": speeds.bodies,
            "rubbing": speeds.rubbing,
            "ratios": {key: getattr(ratios, key) for key in ("inner", "outer", "carrier", "bodies")},
        },
        "angles": turned,
        "path": {
            "x": path.centres.x.T, "y": path.centres.y.T, "body_angles": spins.bodies.T,
            "inner": {**_both(path.inner_centre), "angle": spins.inner},
            "outer": {**_both(path.outer_centre), "angle": spins.outer},
            "carrier": spins.carrier,
        },
        "checks": {"contacts": _contacts(design, made)},
        "result": {"code": int(code), "name": code.name.lower(), "message": wrong or "The chain closes."},
    }  # fmt: skip
    return _plain(found)


def _plain(value: Any) -> Any:
    """Arrays on the host, single numbers as Python's own."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, jax.Array):
        value = np.asarray(value)
        return float(value) if value.ndim == 0 else value
    return value


def _both(at: Vec) -> dict[str, Any]:
    return {"x": at.x, "y": at.y}


def _curve(design: Rolling) -> dict[str, Any]:
    curve = centre_curve(design)
    return {**_both(curve.centre), "semi_major": curve.major, "semi_minor": curve.minor}


def _limits(design: Rolling) -> dict[str, Any]:
    """What bounds the chain, and what would close it."""
    inner, outer, e = design.inner_radius, design.outer_radius, design.eccentricity
    apart, edge = clearances(design), margins(design)
    closes = float(edge.closing) >= 0
    return {
        "largest_radius": 0.5 * (outer + jnp.abs(e) - inner), "smallest_radius": 0.5 * (outer - jnp.abs(e) - inner),
        "ring_margin": edge.rings, "closing_margin": edge.closing,
        "closing_outer_radius": closing_outer_radius(inner, design.bodies, e, design.turns),
        "closing_eccentricity": closing_eccentricity(inner, outer, design.bodies, design.turns) if closes else None,
        "fitting_bodies": fitting_bodies(design),
        "least_clearance": float(jnp.min(apart)) if apart.size else None,
    }  # fmt: skip


def _contacts(design: Rolling, made: Chain) -> float:
    """Largest distance, or overlap, of surfaces that should touch, over the outer radius; measured from centres."""
    x, y, r = (np.asarray(part) for part in (made.centres.x, made.centres.y, made.radii))
    inner, outer, e = (float(each) for each in (design.inner_radius, design.outer_radius, design.eccentricity))
    gaps = [np.hypot(x, y) - (inner + r), np.hypot(x - e, y) - (outer - r)]
    gaps.append(np.hypot(np.diff(x, append=x[0]), np.diff(y, append=y[0])) - (r + np.roll(r, -1)))
    return float(max(np.max(np.abs(gap)) for gap in gaps)) / outer if outer > 0 else math.nan
