"""Compiling for one use: less optimised machine code, ready several times sooner, and kept for the next process.

JAX's own compilation cache spares compiling, but a program must be traced again to be found in it, which takes as long.
Here the finished program itself is kept, under everything it depends on: the package's sources, the versions of JAX,
the processor, the structure and shapes of the arguments. The files lie in the folder of `keep_in` (the command line's:
in the user's own home), else in JAX's compilation cache folder; without either nothing is kept. They may be deleted at
any time.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import inspect
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
from jax.experimental import serialize_executable

from linkjax._types import Tracer, as_float

# A single analysis runs for milliseconds and compiles for seconds: no LLVM optimisation, no MLIR fusion emitters
# (measured: 6.2 s of compilation become 1.7 s, and 1.2 ms of running 1.6 ms).
SOONER: dict[str, bool | str] = {"xla_backend_optimization_level": "0", "xla_cpu_use_fusion_emitters": False}

_MADE: weakref.WeakSet[CompiledSoon] = weakref.WeakSet()  # every function compiled here
_KEPT: list[Path] = []  # the folder they are kept in, if one was named


def keep_in(folder: Path | None) -> None:
    """Keep compiled programs in this folder, which must exist."""
    _KEPT[:] = [folder] if folder else []


class CompiledSoon:
    """A function jitted for one use. Inside other jax transformations it is a plain `jax.jit`.

    `ahead` starts compiling from shapes alone, so that a chain of programs, each of which needs the values of the one
    before, compiles on all cores.
    """

    def __init__(self, function: Callable, static: tuple[str, ...]):
        functools.update_wrapper(self, function)
        self.function, self.static = function, static
        self.plain, self.signature = jax.jit(function, static_argnames=static), inspect.signature(function)
        self.programs: dict[Any, Program] = {}
        _MADE.add(self)

    def __call__(self, *args, **kwargs):
        fixed, leaves, tree = self._flat(args, kwargs)
        if any(isinstance(leaf, Tracer) for leaf in leaves) or jax.config.values["jax_disable_jit"]:
            return self.plain(*args, **kwargs)
        key, program = self._program(fixed, leaves, tree)
        try:
            found = program.run.result()(*leaves)
            if program.kept is not None:  # read from a file: does it run?
                jax.block_until_ready(found)
                self.programs[key] = program = program._replace(kept=None)
        except Exception:
            self.programs.pop(key, None)  # it may have been a matter of the moment
            if program.kept is None:
                raise
            _delete(program.kept)  # damaged, or not of this machine after all: make it anew, whether it went or not
            program = self.programs[key] = _made(self.function, fixed, leaves, tree, program.kept)
            found = program.run.result()(*leaves)
        return jax.tree.unflatten(jax.tree.structure(program.result), found)

    def ahead(self, *args, **kwargs) -> Any:
        """Start compiling for arguments of these shapes; the shapes of the result."""
        return self._program(*self._flat(args, kwargs))[1].result

    def _flat(self, args, kwargs) -> tuple[dict[str, Any], list, Any]:
        """Static arguments, leaves of the others, and their structure."""
        given = dict(self.signature.bind(*args, **kwargs).arguments)
        fixed = {name: given.pop(name) for name in self.static if name in given}
        leaves, tree = jax.tree.flatten(given)
        return fixed, [_here(leaf) for leaf in leaves], tree

    def _program(self, fixed: dict[str, Any], leaves: list, tree: Any) -> tuple[Any, Program]:
        key = tree, tuple((leaf.shape, leaf.dtype) for leaf in leaves), tuple(fixed.items())
        if key not in self.programs:
            self.programs[key] = _program(self.function, fixed, leaves, tree)
        return key, self.programs[key]


def _here(leaf: Any) -> Any:
    """A leaf as the program takes it: numbers as arrays, arrays on the first device (those of a population are not)."""
    if isinstance(leaf, int | float):
        return as_float(leaf)
    if isinstance(leaf, jax.Array) and not isinstance(leaf, Tracer) and leaf.devices() != {jax.devices()[0]}:
        return jax.device_put(leaf, jax.devices()[0])
    return leaf


class Program(NamedTuple):
    """A program, compiled or on its way to be: its function of flat arguments, the shapes of its result, its file."""

    run: Future[Callable]
    result: Any
    kept: Path | None


def compiled_soon(function: Callable | None = None, *, static: tuple[str, ...] = ()) -> Any:
    """Jit a function for one use."""
    return CompiledSoon(function, static) if function else functools.partial(compiled_soon, static=static)


def stop() -> None:
    """Give up what has not begun to compile."""
    _pool().shutdown(wait=False, cancel_futures=True)
    _pool.cache_clear()


def forget() -> None:
    """Drop every compiled program of this process, JAX's own too. A program takes some hundred memory maps, of which
    a process may have 65 530 on Linux; beyond that XLA crashes."""
    for function in _MADE:
        function.programs.clear()
    jax.clear_caches()
    gc.collect()


def _program(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any) -> Program:
    """The program for arguments of these shapes: read if it was kept, else made."""
    file = _kept_in(function, fixed, leaves, tree)
    if file is not None and file.exists():
        try:
            content, shapes = pickle.loads(file.read_bytes())
            return Program(_aside(_load, content), shapes, file)
        except Exception:  # damaged: make it anew
            _delete(file)
    return _made(function, fixed, leaves, tree, file)


def _made(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any, file: Path | None) -> Program:
    """The program, traced here and compiled on another core, to be kept in the file."""
    signature, structures = inspect.signature(function), []

    def flat(*leaves):
        given = inspect.BoundArguments(signature, {**jax.tree.unflatten(tree, leaves), **fixed})
        found, structure = jax.tree.flatten(function(*given.args, **given.kwargs))
        structures.append(structure)
        return found

    if file is not None:
        # never found in JAX's own cache, neither under other sources nor as another process has just left it there: an
        # executable that was itself read loses functions when it is written again
        flat.__name__ = f"linkjax_{uuid.uuid4().hex}"
    traced = jax.jit(flat).trace(*leaves)
    shapes = jax.tree.unflatten(
        structures[-1], [jax.ShapeDtypeStruct(out.shape, out.dtype) for out in jax.tree.leaves(traced.out_info)]
    )
    return Program(_aside(_compile, traced.lower(), file, shapes), shapes, None)


def _aside(function: Callable, *args: Any) -> Future:
    """The result to be of a function that runs on another core."""
    return _pool().submit(function, *args)


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count(), "linkjax-compile")


@functools.cache
def _linear_algebra() -> None:
    """Make JAX find the routines of LAPACK, which it does when it lowers the first program that needs them; one that is
    read jumps to them wherever they are."""
    jax.jit(jax.lax.linalg.lu).lower(jax.ShapeDtypeStruct((1, 1), float))


def _load(content: tuple) -> Callable:
    _linear_algebra()
    return serialize_executable.deserialize_and_load(*content, execution_devices=jax.devices()[:1])


def _compile(lowered: Any, file: Path | None, shapes: Any) -> Callable:
    """Compile, and keep what was compiled."""
    made = compiled_sooner(lowered)
    if file is not None:
        try:
            content = pickle.dumps((serialize_executable.serialize(made), shapes))
        except (AttributeError, TypeError, ValueError, pickle.PicklingError):
            return made  # a program that calls back into Python cannot be kept
        _write(file, content)
    return made


def compiled_sooner(lowered: Any, options: dict[str, bool | str] | None = None) -> Any:
    """A lowered program compiled for one use, with those of the options that the installed XLA knows."""
    options = SOONER if options is None else options
    try:
        return lowered.compile(compiler_options=options)
    except Exception as error:
        known = {name: value for name, value in options.items() if name not in str(error)}
        if known == options:
            raise
        return compiled_sooner(lowered, known)


def _write(file: Path, content: bytes) -> None:
    """Write a file whole or not at all; a full or read-only disk is no reason to fail."""
    part = file.with_name(f"{file.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        os.replace(part, file)
    except OSError:
        _delete(part)


def _delete(file: Path) -> None:
    """Delete a file if that is possible; in a folder that several people share it may not be."""
    with contextlib.suppress(OSError):
        file.unlink()


def _kept_in(function: Callable, fixed: dict[str, Any], leaves: list, tree: Any) -> Path | None:
    """The file of a program, None where nothing is kept: that needs a folder, and a program that its name and the
    package's sources tell apart. What a user's own function, load or group does they do not tell."""
    if not _ours(function, tree):
        return None
    folder = Path(_KEPT[0] if _KEPT else jax.config.values["jax_compilation_cache_dir"] or "")
    if folder == Path() or not folder.is_dir():
        return None
    arguments = [(leaf.shape, str(leaf.dtype)) for leaf in leaves]
    name = f"{function.__module__}.{function.__qualname__}"
    everything = repr((name, fixed, str(tree), arguments, jax.device_count(), SOONER, _machine()))
    return folder / f"linkjax-{hashlib.sha256(everything.encode()).hexdigest()[:32]}"


def _ours(function: Callable, tree: Any) -> bool:
    """Whether a function belongs to the package, and all that the tree of its arguments is made of."""
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
        if kind is not None and kind[0].__module__.split(".")[0] not in ("linkjax", "builtins"):
            return False
        nodes += node.children()
    return True


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
