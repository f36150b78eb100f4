"""Fair timing on a noisy machine: alternating rounds of both programs, medians of paired ratios with quartiles."""

from __future__ import annotations

import contextlib
import ctypes
import math
import time
from collections.abc import Callable

import jax
import numpy as np

KEPT = {-1: 2**31 - 1, -2: 2**28, -3: 2**25, -8: 1}  # M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD, M_ARENA_MAX
ROUNDS = 15
TURN = 0.05  # s


def keep_memory() -> None:
    """Make the C library keep freed memory where this is possible (glibc). Otherwise every large new array causes page
    faults, some hundred nanoseconds for 4 KiB, and the timing measures the memory system, not the program."""
    with contextlib.suppress(OSError, TypeError, AttributeError):
        library = ctypes.CDLL(None)
        for option, value in KEPT.items():
            library.mallopt(option, value)


def seconds(run: Callable[[], object], calls: int = 1) -> float:
    """Wall time (s) of one call with completed results; the mean of several successive calls."""
    start = time.perf_counter()
    for _ in range(calls):
        jax.block_until_ready(run())
    return (time.perf_counter() - start) / calls


def by_turns(*runs: Callable[[], object], rounds: int = ROUNDS) -> list[np.ndarray]:
    """Wall times (s) of one call of several programs, run alternately. Short programs are called repeatedly until a
    turn lasts `TURN`, because the first call after another program finds caches and threads cold. Two rounds are run
    before the timing starts."""
    for run in runs:
        seconds(run)
    calls = [max(1, math.ceil(TURN / seconds(run))) for run in runs]
    times = np.asarray([[seconds(run, n) for run, n in zip(runs, calls, strict=True)] for _ in range(rounds)])
    return list(times.T)


def line(name: str, value: float, unit: str) -> None:
    """One result on one line: `name value unit`."""
    print(f"{name} {value:.4g} {unit}", flush=True)


def ratio(name: str, values: np.ndarray) -> None:
    """Median of paired ratios, with quartiles."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    line(name, middle, "times")
    line(f"{name}.quartile_low", low, "times")
    line(f"{name}.quartile_high", high, "times")
