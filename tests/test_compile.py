"""Programs compiled for one use: kept on disk, found again, made anew when damaged."""

import jax
import jax.numpy as jnp
import pytest

from linkjax import _compile


@pytest.fixture
def folder(tmp_path):
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def make(traced):
    @_compile.compiled_soon(static=("power",))
    def raised(tree, power):
        traced.append(power)
        return {"sum": tree["a"] ** power + tree["b"], "none": None}

    return raised


def test_kept_and_found_again(folder):
    tree, traced = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, []
    for _ in range(2):  # a new wrapper each time, as a new process would have
        assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert traced == [2]
    assert float(make(traced)(tree, 3)["sum"]) == 28.0
    assert traced == [2, 3]
    assert len(list(folder.glob("linkjax-*"))) == 2


def test_damaged_files_are_replaced(folder):
    tree, traced = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, []
    make(traced)(tree, power=2)
    (file,) = folder.glob("linkjax-*")
    file.write_bytes(b"nonsense")
    assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert len(traced) == 2
    assert len(file.read_bytes()) > 100


def test_inside_transformations_it_is_a_plain_jit(folder):
    raised = make([])
    slope = jax.grad(lambda a: raised({"a": a, "b": jnp.asarray(1.0)}, 2)["sum"])(jnp.asarray(3.0))
    assert float(slope) == 6.0
    assert list(folder.glob("linkjax-*")) == []


def test_callbacks_into_python_are_not_kept(folder):
    seen = []

    @_compile.compiled_soon
    def told(x):
        jax.debug.callback(lambda x: seen.append(float(x)), x)
        return 2 * x

    assert float(told(jnp.asarray(4.0))) == 8.0
    jax.effects_barrier()
    assert seen == [4.0]
    assert list(folder.glob("linkjax-*")) == []


def test_aside_waits_for_the_result():
    ready = _compile.aside(lambda x: x + 1, jnp.asarray(1.0))
    assert float(ready()) == 2.0
    failing = _compile.aside(lambda x: 1 / 0, jnp.asarray(1.0))
    with pytest.raises(ZeroDivisionError):
        failing()
