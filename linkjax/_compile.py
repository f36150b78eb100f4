"""Compiling for one use: less optimised machine code, ready several times sooner, and kept for the next process.

JAX's own compilation cache spares compiling, but a program must be traced again to be found in it, which takes as long.
Here the finished program itself is kept, under everything it depends on: the package's sources, the versions of JAX,
the processor, the structure and shapes of the arguments. The files lie in JAX's compilation cache folder, in the user's
own home, are written and read only where such a folder is set, and may be deleted at any time.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import inspect
import os
import pickle
import platform
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from jax.core import Tracer as Tracer
from jax.experimental import serialize_executable

# A single analysis runs for milliseconds and compiles for seconds: no LLVM optimisation, no MLIR fusion emitters
# (measured: 6.2 s of compilation become 1.7 s, and 1.2 ms of running 1.6 ms).
SOONER: dict[str, bool | str] = {"xla_backend_optimization_level": "0", "xla_cpu_use_fusion_emitters": False}


_MADE: list[dict] = []  # the programs of every function compiled here


def compiled_soon(function: Callable | None = None, *, static: tuple[str, ...] = ()) -> Callable:
    """Jit a function for one use. Inside other jax transformations it is a plain `jax.jit`."""
    if function is None:
        return functools.partial(compiled_soon, static=static)
    plain, signature = jax.jit(function, static_argnames=static), inspect.signature(function)
    programs: dict[Any, tuple[Callable, Any]] = {}
    _MADE.append(programs)

    @functools.wraps(function)
    def call(*args, **kwargs):
        given = dict(signature.bind(*args, **kwargs).arguments)
        fixed = {name: given.pop(name) for name in static if name in given}
        leaves, tree = jax.tree.flatten(given)
        leaves = [jnp.asarray(leaf, dtype=float) if isinstance(leaf, int | float) else leaf for leaf in leaves]
        if any(isinstance(leaf, Tracer) for leaf in leaves):
            return plain(*args, **kwargs)
        key = tree, tuple((leaf.shape, leaf.dtype) for leaf in leaves), tuple(fixed.items())
        if key not in programs:
            programs[key] = _program(function, fixed, leaves, tree)
        run, result = programs[key]
        return jax.tree.unflatten(result, run(*leaves))

    return call


def forget() -> None:
    """Drop every compiled program of this process, JAX's own too. A program takes some hundred memory maps, of which
    a process may have 65 530 on Linux; beyond that XLA crashes."""
    for programs in _MADE:
        programs.clear()
    jax.clear_caches()
    gc.collect()


def aside(function: Callable, *args: Any) -> Callable[[], Any]:
    """Start `function(*args)` beside what follows; the function returned waits for the result.

    Two programs compile at once where there are two cores. Under jax transformations, and where the precision is set
    for the present thread only, it is simply called.
    """
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(args))
    if traced or jax.config.values["jax_enable_x64"] != (jnp.zeros(()).dtype == jnp.float64):
        result = function(*args)
        return lambda: result
    pool = ThreadPoolExecutor(1)
    started = pool.submit(function, *args)
    pool.shutdown(wait=False)
    return started.result


def _program(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any) -> tuple[Callable, Any]:
    """The compiled function of flat arguments, with the structure of its result: read if it was kept, else made."""
    file = _kept_in(function, fixed, leaves, tree)
    if file is not None and file.exists():
        try:
            payload, arguments, results, shape = pickle.loads(file.read_bytes())
            run = serialize_executable.deserialize_and_load(
                payload, arguments, results, execution_devices=jax.devices()[:1]
            )
            jax.block_until_ready(run(*leaves))  # what came out of JAX's own cache may not run once it is kept here
            return run, jax.tree.structure(shape)
        except Exception:  # damaged, or not of this machine after all: make it anew
            file.unlink(missing_ok=True)
    signature, structures = inspect.signature(function), []

    def flat(*leaves):
        given = inspect.BoundArguments(signature, {**jax.tree.unflatten(tree, leaves), **fixed})
        found, structure = jax.tree.flatten(function(*given.args, **given.kwargs))
        structures.append(structure)
        return found

    if file is not None:
        flat.__name__ = file.name.replace("-", "_")  # never found in JAX's own cache under other sources
    made = jax.jit(flat).lower(*leaves).compile(compiler_options=_accepted())
    if file is not None:
        shape = jax.tree.unflatten(structures[-1], range(structures[-1].num_leaves))
        try:
            content = pickle.dumps((*serialize_executable.serialize(made), shape))
        except (AttributeError, TypeError, ValueError, pickle.PicklingError):
            return made, structures[-1]  # a program that calls back into Python cannot be kept
        _write(file, content)
    return made, structures[-1]


def _write(file: Path, content: bytes) -> None:
    """Write a file whole or not at all; a full or read-only disk is no reason to fail."""
    try:
        with tempfile.NamedTemporaryFile(dir=file.parent, delete=False) as part:
            part.write(content)
        os.replace(part.name, file)
    except OSError:
        pass


def _kept_in(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any) -> Path | None:
    """The file of a program, None where nothing is kept."""
    folder = jax.config.values["jax_compilation_cache_dir"]
    if not folder or not Path(folder).is_dir():
        return None
    arguments = [(leaf.shape, str(leaf.dtype)) for leaf in leaves]
    name = f"{function.__module__}.{function.__qualname__}"
    everything = repr((name, fixed, str(tree), arguments, jax.device_count(), SOONER, _machine()))
    return Path(folder) / f"linkjax-{hashlib.sha256(everything.encode()).hexdigest()[:32]}"


@functools.cache
def _machine() -> tuple[str, ...]:
    """The package's sources, the versions of JAX, its flags, and the processor."""
    sources = hashlib.sha256()
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        sources.update(file.read_bytes())
    features = Path("/proc/cpuinfo")
    lines = features.read_text().splitlines() if features.exists() else []
    flags = [line for line in lines if line.startswith(("flags", "Features"))][:1]
    backend = jax.devices()[0].client.platform_version
    return sources.hexdigest(), jax.__version__, backend, os.environ.get("XLA_FLAGS", ""), platform.machine(), *flags


@functools.cache
def _accepted() -> dict[str, bool | str]:
    """Those of the options that the installed XLA knows."""
    known: dict[str, bool | str] = {}
    for name, value in SOONER.items():
        try:
            jax.jit(lambda x: x + 1, compiler_options={name: value}).lower(0).compile()
        except Exception as error:
            if name not in str(error):
                raise
        else:
            known[name] = value
    return known
