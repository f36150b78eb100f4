"""Earlier names and their replacements: messages about unknown names give the new one."""

import sys
from collections.abc import Callable, Iterable
from typing import Any

RENAMED = {
    "Met": "ConstraintResult",
    "RP": "RedundantSlider",
    "RR": "RedundantLink",
    "Slide": "LinearDriver",
    "assemblies": "assembly_modes",
    "build_task": "build_problem",
    "crank_limits": "crank_ranges",
    "inside": "internal",
    "largest_speed": "max_crank_speed",
    "least_inertia": "min_inertia_ratio",
    "least_margin": "min_margin",
    "load_task": "load_problem",
    "lost_at_start": "not_assembled_at_start",
    "many": "multistart",
    "over_designs": "map_designs",
    "peak_told": "peak_shown",
    "reduce": "reduced_model",
    "regime_margin": "steady_state_margin",
    "slide": "linear_driver",
    "smallest_margin": "min_margin",
    "smallest_speed": "min_crank_speed",
    "smallest_transmission_angle": "min_transmission_angle",
    "steady": "steady_motion",
    "tied": "linked",
    "today": "initial",
}
KINDS = {"RR": "redundant_link", "RP": "redundant_slider"}


def renamed(name: str, known: Iterable[str]) -> str:
    """The known name that replaces an old one; an empty string where there is none."""
    every = set(known)
    return next((new for new in (RENAMED.get(name), KINDS.get(name)) if new in every), "")


def old_names(module: str) -> Callable[[str], Any]:
    """The `__getattr__` of a subpackage: raises `AttributeError`, with the new name where the name is an old one."""

    def missing(name: str) -> Any:
        here = sys.modules[module]
        problem = f"module {module!r} has no attribute {name!r}"
        if new := renamed(name, vars(here)):
            raise AttributeError(f"{problem}; it is called {new!r} now")
        raise AttributeError(problem, name=name, obj=here)

    return missing
