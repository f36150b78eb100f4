"""Fair timing on a noisy machine: rounds of both sides by turns, medians of paired ratios with quartiles."""

from __future__ import annotations

import time
from collections.abc import Callable

import jax
import numpy as np

ROUNDS = 15


def seconds(run: Callable[[], object]) -> float:
    """Wall time of one call, results waited for."""
    start = time.perf_counter()
    jax.block_until_ready(run())
    return time.perf_counter() - start


def by_turns(*runs: Callable[[], object], rounds: int = ROUNDS) -> list[np.ndarray]:
    """Wall times (s) of several programs run by turns; one round before the clock starts."""
    for run in runs:
        seconds(run)
    times = np.asarray([[seconds(run) for run in runs] for _ in range(rounds)])
    return list(times.T)


def line(name: str, value: float, unit: str) -> None:
    """One figure on one line: `name value unit`."""
    print(f"{name} {value:.4g} {unit}", flush=True)


def ratio(name: str, values: np.ndarray) -> None:
    """Median of paired ratios, with quartiles."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    line(name, middle, "times")
    line(f"{name}.quartile_low", low, "times")
    line(f"{name}.quartile_high", high, "times")
