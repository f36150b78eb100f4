"""Compiling for one use: less optimised machine code, compiled several times faster, and kept for the next process.

JAX's own compilation cache saves compiling, but it needs the program traced again, which takes as long. Here the
compiled program itself is kept. Its key is everything it depends on: the package's sources, the versions of JAX, the
processor, and the structure and shapes of the arguments. The files are in the folder of `keep_in`, otherwise in JAX's
compilation cache folder, otherwise in the user's cache folder, so that a script compiles once, like the command line.
`LINKJAX_CACHE=off` in the environment, or `keep_in(None)`, keeps nothing. The files may be deleted at any time.

Programs are small and less optimised (no LLVM optimisation), because one large program takes several times as long to
compile. They are traced one after another and compiled in threads at the same time: each stage needs the values of the
previous ones, but its compilation only their shapes, which tracing gives.

Measured: a second `linkjax analyse` takes a fifth of the time of the first. Programs to be kept are never read from
JAX's own cache (each has a unique name there): an executable that is read and written again loses functions, which
happened when two processes compiled the same program at once. The first call of a stored executable is waited for, so
that one that fails is compiled again.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import inspect
import operator
import os
import pickle
import platform
import uuid
import weakref
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import serialize_executable

from linkjax._config import cache_folder
from linkjax._types import Tracer

# A single analysis runs for milliseconds and compiles for seconds: no LLVM optimisation, no MLIR fusion emitters
# (measured: 6.2 s of compilation become 1.7 s, and 1.2 ms of running 1.6 ms).
SOONER: dict[str, bool | str] = {"xla_backend_optimization_level": "0", "xla_cpu_use_fusion_emitters": False}

_MADE: weakref.WeakSet[CompiledSoon] = weakref.WeakSet()  # every function compiled here
_KEPT: list[Path | None] = []  # their folder, if one was named
# settings of JAX that a program depends on
LOWERED_BY = ("jax_enable_x64", "jax_default_matmul_precision", "jax_debug_nans", "jax_debug_infs", "jax_enable_checks")


def keep_in(folder: Path | None) -> None:
    """Keep compiled programs in this folder, which must exist; none with None."""
    _KEPT[:] = [folder]


def _folder() -> Path | None:
    """The folder of kept programs, None where none are kept."""
    if _KEPT:
        return _KEPT[0]
    return None if os.environ.get("LINKJAX_CACHE", "").lower() == "off" else cache_folder()


class CompiledSoon:
    """A function jitted for one use. Inside other jax transformations it is a plain `jax.jit`.

    `ahead` starts compiling from shapes alone, so that a chain of programs, each of which needs the values of the
    previous one, compiles on all cores.
    """

    def __init__(self, function: Callable, static: tuple[str, ...]):
        functools.update_wrapper(self, function)
        self.function, self.static = function, static
        self.plain, self.signature = jax.jit(function, static_argnames=static), inspect.signature(function)
        self.names = tuple(name for name in self.signature.parameters if name not in static)
        self.positional, self.named = len(self.names), set(static)
        self.programs: dict[Any, Program] = {}
        _MADE.add(self)

    def __call__(self, *args, **kwargs):
        fixed, leaves, tree = self._flat(args, kwargs)
        if leaves is None or _disabled(jax.config):
            return self.plain(*args, **kwargs)
        key, program = self._program(fixed, leaves, tree)
        try:
            found = program.run.result()(*leaves)
            if program.kept is not None:  # read from a file: check that it runs
                jax.block_until_ready(found)
                self.programs[key] = program = program._replace(kept=None)
        except Exception:
            self.programs.pop(key, None)  # the error may be temporary
            if program.kept is None:
                raise
            _delete(program.kept)  # damaged, or made on another machine: compile it again, even if the file remains
            program = self.programs[key] = _made(self.function, fixed, leaves, tree, program.kept)
            found = program.run.result()(*leaves)
        return jax.tree.unflatten(program.tree, found)

    def ahead(self, *args, **kwargs) -> Any:
        """Start compiling for arguments of these shapes; returns the shapes of the result."""
        return self._program(*self._flat(args, kwargs))[1].result

    def _flat(self, args, kwargs) -> tuple[dict[str, Any], Any, Any]:
        """Static arguments, leaves of the others (None where one is traced), and their structure."""
        if len(args) == self.positional and kwargs.keys() == self.named:
            fixed, given = kwargs, dict(zip(self.names, args, strict=True))
        else:
            given = dict(self.signature.bind(*args, **kwargs).arguments)
            fixed = {name: given.pop(name) for name in self.static if name in given}
        leaves, tree = jax.tree.flatten(given)
        if _at_hand().issuperset(map(type, leaves)):
            return fixed, leaves, tree
        for i, leaf in enumerate(leaves):
            if isinstance(leaf, Tracer):
                return fixed, None, tree
            if not isinstance(leaf, _READY) or _several():
                leaves[i] = _here(leaf)
        return fixed, leaves, tree

    def _program(self, fixed: dict[str, Any], leaves: list, tree: Any) -> tuple[Any, Program]:
        key = tree, tuple(map(_kind, leaves)), tuple(fixed.items()), _wide(jax.config)
        if key not in self.programs:
            self.programs[key] = _program(self.function, fixed, leaves, tree)
        return key, self.programs[key]


_disabled, _wide = operator.attrgetter("jax_disable_jit"), operator.attrgetter("jax_enable_x64")
_kind = operator.attrgetter("shape", "dtype")
_READY = (jax.Array, np.ndarray, jax.ShapeDtypeStruct)


@functools.cache
def _several() -> bool:
    """Whether there are several devices, so that arrays may lie on another one."""
    return jax.device_count() > 1


@functools.cache
def _at_hand() -> set[type]:
    """The classes of leaves that programs take as they are."""
    with jax.ensure_compile_time_eval():  # it may be asked for during tracing
        return set() if _several() else {type(jnp.zeros(())), np.ndarray}


def _here(leaf: Any) -> Any:
    """A leaf as the program takes it: numbers as arrays, arrays moved to the first device."""
    if isinstance(leaf, int | float):
        return np.asarray(leaf, jnp.result_type(float))  # not of jax, which would make it a tracer during tracing
    if isinstance(leaf, jax.Array) and not isinstance(leaf, Tracer) and leaf.devices() != {jax.devices()[0]}:
        return jax.device_put(leaf, jax.devices()[0])
    return leaf


class Program(NamedTuple):
    """A program, compiled or being compiled: its function of flat arguments, the shapes and the structure of its
    result, and its file."""

    run: Future[Callable]
    result: Any
    tree: Any
    kept: Path | None


def compiled_soon(function: Callable | None = None, *, static: tuple[str, ...] = ()) -> Any:
    """Jit a function for one use."""
    return CompiledSoon(function, static) if function else functools.partial(compiled_soon, static=static)


def stop() -> None:
    """Cancel compilations that have not started."""
    _pool().shutdown(wait=False, cancel_futures=True)
    _pool.cache_clear()


def progress() -> tuple[int, int]:
    """How many programs of this process are compiled, and how many there are so far; from any thread."""
    runs = [program.run for function in tuple(_MADE) for program in tuple(function.programs.values())]
    return sum(run.done() for run in runs), len(runs)


_PLANNED: set[Any] = set()  # what was compiled ahead


def planned(what: Any) -> bool:
    """Whether this was compiled ahead before; from now on it counts as compiled ahead."""
    known = what in _PLANNED
    _PLANNED.add(what)
    return known


def forget() -> None:
    """Drop every compiled program of this process, including JAX's own. A program takes about a hundred memory maps,
    and Linux allows a process 65 530; beyond that XLA crashes."""
    _PLANNED.clear()
    for function in _MADE:
        function.programs.clear()
    jax.clear_caches()
    gc.collect()


def _program(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any) -> Program:
    """The program for arguments of these shapes: read if it was kept, otherwise compiled."""
    file = _kept_in(function, fixed, leaves, tree)
    if file is not None and file.exists():
        try:
            content, shapes = pickle.loads(file.read_bytes())
            return Program(_aside(_load, content), shapes, jax.tree.structure(shapes), file)
        except Exception:  # damaged: compile it again
            _delete(file)
    return _made(function, fixed, leaves, tree, file)


def _made(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any, file: Path | None) -> Program:
    """The program, traced here and compiled in another thread, to be kept in the file."""
    signature, structures = inspect.signature(function), []

    def flat(*leaves):
        given = inspect.BoundArguments(signature, {**jax.tree.unflatten(tree, leaves), **fixed})
        found, structure = jax.tree.flatten(function(*given.args, **given.kwargs))
        structures.append(structure)
        return found

    if file is not None:
        # a unique name, so that JAX's own cache never has this program: an executable that was read from a cache loses
        # functions when it is written again
        flat.__name__ = f"linkjax_{uuid.uuid4().hex}"
    traced = jax.jit(flat).trace(*leaves)
    shapes = jax.tree.unflatten(
        structures[-1], [jax.ShapeDtypeStruct(out.shape, out.dtype) for out in jax.tree.leaves(traced.out_info)]
    )
    return Program(_aside(_compile, traced.lower(), file, shapes), shapes, structures[-1], None)


def _aside(function: Callable, *args: Any) -> Future:
    """The future result of a function that runs in another thread."""
    return _pool().submit(function, *args)


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count(), "linkjax-compile")


@functools.cache
def _linear_algebra() -> None:
    """Make JAX load the routines of LAPACK, as it does when it lowers the first program that needs them; a program read
    from a file needs them loaded."""
    jax.jit(jax.lax.linalg.lu).lower(jax.ShapeDtypeStruct((1, 1), float))


def _load(content: tuple) -> Callable:
    _linear_algebra()
    return serialize_executable.deserialize_and_load(*content, execution_devices=jax.devices()[:1])


def _compile(lowered: Any, file: Path | None, shapes: Any) -> Callable:
    """Compile, and keep the result."""
    made = compiled_sooner(lowered)
    if file is not None:
        try:
            content = pickle.dumps((serialize_executable.serialize(made), shapes))
        except (AttributeError, TypeError, ValueError, pickle.PicklingError):
            return made  # a program that calls back into Python cannot be kept
        _write(file, content)
    return made


def compiled_sooner(lowered: Any, options: dict[str, bool | str] | None = None) -> Any:
    """A lowered program compiled for one use, with the options that the installed XLA accepts."""
    options = SOONER if options is None else options
    try:
        return lowered.compile(compiler_options=options)
    except Exception as error:
        known = {name: value for name, value in options.items() if name not in str(error)}
        if known == options:
            raise
        return compiled_sooner(lowered, known)


def _write(file: Path, content: bytes) -> None:
    """Write a file completely or not at all; a full or read-only disk is not an error."""
    part = file.with_name(f"{file.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        os.replace(part, file)
    except OSError:
        _delete(part)


def _delete(file: Path) -> None:
    """Delete a file if possible; in a shared folder it may not be."""
    with contextlib.suppress(OSError):
        file.unlink()


def _kept_in(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any) -> Path | None:
    """The file of a program, None if it is not kept. A program is kept only if there is a folder and the package's
    sources determine it, so not if it contains a user-defined function, load or group."""
    folder = _folder() if _ours(function, tree) and _plain(fixed) else None
    if folder is None or not folder.is_dir():
        return None
    arguments = [(leaf.shape, str(leaf.dtype)) for leaf in leaves]
    name = f"{function.__module__}.{function.__qualname__}"
    settings = [jax.config.values.get(name) for name in LOWERED_BY]
    everything = repr((name, fixed, str(tree), arguments, jax.device_count(), SOONER, settings, _machine()))
    return folder / f"linkjax-{hashlib.sha256(everything.encode()).hexdigest()[:32]}"


def _ours(function: Callable, tree: Any) -> bool:
    """Whether a function, and every type in the tree of its arguments, belongs to the package."""
    plain = inspect.unwrap(function)
    if (
        hasattr(function, "__self__")
        or not inspect.isfunction(plain)
        or plain.__closure__
        or not function.__module__.startswith("linkjax.")
    ):
        return False
    nodes = [tree]
    while nodes:
        node = nodes.pop()
        kind = node.node_data()
        if kind is not None and isinstance(kind[1], jax.tree_util.PyTreeDef):
            nodes.append(kind[1])
        if kind is not None and kind[0].__module__.split(".")[0] not in ("linkjax", "builtins"):
            return False
        nodes += node.children()
    return True


def _plain(value: Any) -> bool:
    """Whether a static argument consists of numbers and strings, so that its representation determines it."""
    if isinstance(value, dict | tuple | list):
        return all(map(_plain, value.values() if isinstance(value, dict) else value))
    return value is None or isinstance(value, str | int | float)


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
