"""Settings of JAX that belong to a whole program: precision, compilation cache, number of CPU devices.

Nothing here happens on import, and the library never calls it. `enable_x64` and `use_cpu_devices` are for programs that
own their process, the command line among them; the other two are for the command line and the benchmarks.
"""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import jax


def enable_x64() -> None:
    """Make float64 the precision of JAX, and so of linkjax, for this program. Call it before anything is computed."""
    jax.config.update("jax_enable_x64", True)


def cache_home() -> Path:
    """Folder for files that may be deleted at any time: `$XDG_CACHE_HOME/linkjax`, or `~/.cache/linkjax`."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (named if named.is_absolute() else Path.home() / ".cache") / "linkjax"


def cache_folder() -> Path | None:
    """Folder for compiled programs: the one chosen (`JAX_COMPILATION_CACHE_DIR`, or by the program), else
    `cache_home()`; None when it cannot be written, and then everything works, only slower."""
    chosen = jax.config.values["jax_compilation_cache_dir"]
    if chosen and "://" in chosen:  # JAX's own, in the cloud; ours are files
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
    """Show the CPU to JAX as `count` devices (default: one per core this process may use), and return the count.

    Also lets the C library keep memory that was freed: the results of a large population otherwise cost fresh pages
    from the system every time (measured: a fifth of the time of a kinematic sweep).
    A count already chosen (`JAX_NUM_CPU_DEVICES`, or by the program) stays. Raises `RuntimeError`, from JAX, when
    something has been computed already: the number is fixed when the backend starts.
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
