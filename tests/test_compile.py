"""Programs compiled for one use: kept on disk, found again, made anew when damaged."""

import pickle

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


def test_a_kept_program_that_does_not_run_is_made_anew(folder):
    """Whole by its file, but the executable inside is another one."""
    tree, traced = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, []
    make(traced)(tree, power=2)
    (file,) = folder.glob("linkjax-*")
    (payload, *rest), shapes = pickle.loads(file.read_bytes())
    file.write_bytes(pickle.dumps(((payload[:-100], *rest), shapes)))
    assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert traced == [2, 2]
    assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert traced == [2, 2]


def test_compiled_ahead_from_shapes(tmp_path):
    """A chain of two: the second compiles before the first has run, neither is traced again, and both are kept."""
    traced, x = [], {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}
    _compile.keep_in(tmp_path)
    try:
        for _ in range(2):  # the second time as a new process would find it
            one, two = make(traced), make(traced)
            shapes = one.ahead(x, 2)
            assert shapes == {"sum": jax.ShapeDtypeStruct((), jnp.float64), "none": None}
            two.ahead({"a": shapes["sum"], "b": x["b"]}, power=3)
            assert traced == [2, 3]
            assert float(two({"a": one(x, 2)["sum"], "b": x["b"]}, 3)["sum"]) == 1001.0
            assert traced == [2, 3]
    finally:
        _compile.keep_in(None)


def test_what_fails_to_compile_says_so():
    @_compile.compiled_soon
    def wrong(x):
        return x + jnp.ones((2, 3, 4))

    with pytest.raises((TypeError, ValueError)):
        wrong(jnp.ones(7))


def test_options_that_xla_no_longer_knows(monkeypatch):
    monkeypatch.setattr(_compile, "SOONER", {"xla_of_tomorrow": True, **_compile.SOONER})
    assert float(_compile.compiled_soon(lambda x: 2 * x)(jnp.asarray(4.0))) == 8.0
