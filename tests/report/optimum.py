"""An artificial document of an optimisation, with all possible entries."""

import math

OPTIMUM = {
    "scene": "hay-press",
    "linkjax_version": "0",
    "precision": "float64",
    "objective": {"name": "peak_shaking_force", "unit": "N", "sense": "minimise", "before": 400e3, "after": 300e3,
                  "peak_angles": [1.0, 2.0]},
    "variables": {
        "links.rod.length": {"before": 1.0, "after": 0.95, "lower": 0.95, "upper": 1.15, "active": "lower", "unit": "m",
                             "bound_multiplier": 1234.0, "no_effect": False,
                             "linked": {"links.link4.length": {"before": 0.5, "after": 0.475, "unit": "m"}}},
        "points.E.turned": {"before": math.radians(30), "after": math.radians(35), "lower": math.radians(20),
                            "upper": math.radians(40), "active": "", "unit": "rad", "bound_multiplier": None,
                            "no_effect": True, "linked": {}},
    },
    "limits": {
        "peak_drive_torque": {"value": 52e3, "before": 70e3, "bound": 52e3, "sense": "at most", "unit": "N m",
                              "multiplier": 1.25, "met": True, "active": True,
                              "peak_angles": [math.pi / 2, 2 * math.pi / 3]},
        "min_margin": {"value": 0.005, "before": 0.02, "bound": 0.01, "sense": "at least", "unit": "1",
                            "multiplier": 0.0, "met": False, "active": False, "peak_angles": []},
    },
    "before": {"peak_shaking_force": 400e3, "steady_state_margin": None},
    "after": {"peak_shaking_force": 300e3, "steady_state_margin": 0.2},
    "units": {"peak_shaking_force": "N", "steady_state_margin": "1"},
    "history": [{"objective": 300e3 + 100e3 * 0.5**i, "violation": max(0.0, 0.1 * 0.3**i - 1e-5)} for i in range(25)],
    "evaluations": 143,
    "starts": [{"objective": 300e3, "feasible": True, "residual": 3e-10, "evaluations": 123},
               {"objective": None, "feasible": False, "residual": 0.1, "evaluations": 20}],
    "starts_at_optimum": 1,
    "kkt_residual": 3e-10,
    "trade_off": {"limit": "peak_drive_torque", "unit": "N m", "objective_unit": "N",
                  "points": [{"bound": 40e3 + 4e3 * k, "objective": 400e3 - 12e3 * k, "feasible": k > 0,
                              "variables": {}} for k in range(7)]},
    "before_is": "the machine as it was",
    "cases": ["full", "empty"],
    "solver": {"name": "cone", "why": "largest magnitudes"},
    "scene_after": "after.toml",
    "result": {"code": 1, "name": "infeasible", "message": "Limits clash.",
               "conflicts": ["peak_drive_torque", "min_margin"]},
}  # fmt: skip
