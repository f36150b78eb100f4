"""Loads that never act, because what their window waits for does not happen."""

from __future__ import annotations

import warnings
from typing import Any

import jax
import numpy as np
from jaxtyping import Array

from linkjax._display import Numbers
from linkjax.loads import STILL, Passage, Watched, watched
from linkjax.machine import passage_text

SHOW = Numbers()


def warn_of_idle(cycle: Any) -> None:
    """Warn of every load that never acts, with the reason."""
    for load in cycle.scene.loads:
        window = load.window
        if not isinstance(window, Passage) or np.any(cycle.windows[load.name].on != cycle.windows[load.name].off):
            continue
        warnings.warn(
            f"load {load.name!r} never acts: its window is {passage_text(SHOW, window)}, but {_why(cycle, window)}; "
            "change the window, or delete the load",
            stacklevel=3,
        )


def _why(cycle: Any, window: Passage) -> str:
    seen = watched(cycle.scene.mechanism, window, cycle.pose)
    value, d, pace = (np.asarray(part) for part in _followed(seen))
    if not np.any(np.abs(d) > STILL * np.max(pace)):
        return f"{window.of} does not {'move in this direction' if window.point else 'turn'}"
    value = value if window.point else np.unwrap(value)
    if window.link and window.between is None:
        return f"{window.of} has no such limit position"
    low, high = (SHOW.bound(end, window.unit) for end in (value.min(), value.max()))
    return f"{window.of} moves between {low} and {high}"


@jax.jit
def _followed(seen: Watched) -> tuple[Array, Array, Array]:
    """The coordinate of a window, its first derivative, and the one to which this is compared."""
    here = seen.seen()
    return here.value, here.d, seen.pace()
