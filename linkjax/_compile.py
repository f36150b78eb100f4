"""Compiling for one use: less optimised machine code, ready several times sooner."""

from __future__ import annotations

import functools
from collections.abc import Callable

import jax
from jax.core import Tracer as Tracer

# A single analysis runs for milliseconds and compiles for seconds: no LLVM optimisation, no MLIR fusion emitters
# (measured: 6.2 s of compilation become 1.7 s, and 1.2 ms of running 1.6 ms).
SOONER: dict[str, bool | str | int] = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}


def compiled_soon(function: Callable | None = None, *, static: tuple[str, ...] = ()) -> Callable:
    """Jit a function for one use. Inside other jax transformations it is a plain `jax.jit`."""
    if function is None:
        return functools.partial(compiled_soon, static=static)
    plain = jax.jit(function, static_argnames=static)

    @functools.wraps(function)
    def call(*args, **kwargs):
        inside = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((args, kwargs)))
        return (plain if inside else _soon(function, static))(*args, **kwargs)

    return call


@functools.cache
def _soon(function: Callable, static: tuple[str, ...]) -> Callable:
    return jax.jit(function, static_argnames=static, compiler_options=_accepted())


@functools.cache
def _accepted() -> dict[str, bool | str | int]:
    """Those of the options that the installed XLA knows."""
    known = {}
    for name, value in SOONER.items():
        try:
            jax.jit(lambda x: x + 1, compiler_options={name: value}).lower(0).compile()
        except Exception as error:
            if name not in str(error):
                raise
        else:
            known[name] = value
    return known
