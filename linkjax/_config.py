"""Settings of JAX that belong to a whole program: precision, compilation cache, number of CPU devices.

Importing this module changes nothing, and the library calls none of these functions but `cache_folder`. `enable_x64`
and `use_cpu_devices` are for whole programs, such as the command line, `use_compilation_cache` is for the benchmarks.
"""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import jax


def enable_x64() -> None:
    """Make float64 the precision of JAX, and so of linkjax, in this program. Call it before any computation."""
    jax.config.update("jax_enable_x64", True)


def cache_home() -> Path:
    """Folder for files that may be deleted at any time: `$XDG_CACHE_HOME/linkjax`, or `~/.cache/linkjax`."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (named if named.is_absolute() else Path.home() / ".cache") / "linkjax"


def cache_folder() -> Path | None:
    """Folder for compiled programs: the one chosen (`JAX_COMPILATION_CACHE_DIR`, or by the program), otherwise
    `cache_home()`; None if it is not writable, and then everything works, but slower."""
    chosen = jax.config.values["jax_compilation_cache_dir"]
    if chosen and "://" in chosen:  # JAX can use a cloud folder, linkjax needs files
        return None
    folder = Path(chosen) if chosen else cache_home()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


def use_compilation_cache() -> None:
    """Let JAX keep compiled programs in `cache_folder()`, so that the next process need not compile them."""
    folder = cache_folder()
    if folder is not None:
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


def use_cpu_devices(count: int | None = None) -> int:
    """Make the CPU `count` devices for JAX (default: one per core this process may use), and return the count.

    Also makes the C library keep freed memory: otherwise the results of a large population need new pages from the
    system every time (measured: a fifth of the time of a kinematic sweep).
    A count already chosen (`JAX_NUM_CPU_DEVICES`, or by the program) stays. Raises `RuntimeError`, from JAX, after any
    computation: the number is fixed when the backend starts.
    """
    _keep_memory()
    chosen = jax.config.values["jax_num_cpu_devices"]
    if chosen > 0:
        return chosen
    if count is None:
        count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    jax.config.update("jax_num_cpu_devices", count)
    return count


def _keep_memory() -> None:
    """Settings of glibc's malloc; other C libraries have no such function."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    for name, value in ((M_MMAP_THRESHOLD, 2**25), (M_TRIM_THRESHOLD, 2**31 - 1), (M_TOP_PAD, 2**26)):
        mallopt(name, value)


M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD = -1, -2, -3
