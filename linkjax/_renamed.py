"""Earlier names and their replacements: messages about unknown names give the new one."""

from collections.abc import Iterable

RENAMED = {
    "Met": "ConstraintResult",
    "RP": "RedundantSlider",
    "RR": "RedundantLink",
    "Slide": "LinearDriver",
    "assemblies": "assembly_modes",
    "crank_limits": "crank_ranges",
    "largest_speed": "max_crank_speed",
    "least_inertia": "min_inertia_ratio",
    "load_task": "load_problem",
    "many": "multistart",
    "over_designs": "map_designs",
    "reduce": "reduced_model",
    "regime_margin": "steady_state_margin",
    "slide": "linear_driver",
    "smallest_margin": "min_margin",
    "smallest_speed": "min_crank_speed",
    "smallest_transmission_angle": "min_transmission_angle",
    "steady": "steady_motion",
    "today": "initial",
}
KINDS = {"RR": "redundant_link", "RP": "redundant_slider"}


def renamed(name: str, known: Iterable[str]) -> str:
    """The known name that replaces an old one; an empty string where there is none."""
    every = set(known)
    return next((new for new in (RENAMED.get(name), KINDS.get(name)) if new in every), "")
