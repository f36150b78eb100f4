"""Programs compiled for one use: stored on disk, found again, compiled again when damaged."""

import dataclasses
import functools
import gc
import pickle
import re
import subprocess
import sys
import weakref
from concurrent.futures import Future
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import _compile
from linkjax.machine import CHOICES
from linkjax.measures import peak_names
from linkjax.reduction import reduced_model


@pytest.fixture(autouse=True)
def nothing_chosen(monkeypatch):
    """Command line calls in the same process name their own folder."""
    monkeypatch.setattr(_compile, "_KEPT", [])


@pytest.fixture
def ours(monkeypatch):
    """Only programs of the package are stored: treat the functions of these tests as part of it."""
    monkeypatch.setattr(_compile, "_ours", lambda function, tree: True)


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


def test_kept_and_found_again(folder, ours):
    tree, traced = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, []
    for _ in range(2):  # a new wrapper each time, as in a new process
        assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert traced == [2]
    assert float(make(traced)(tree, 3)["sum"]) == 28.0
    assert traced == [2, 3]
    assert len(list(folder.glob("linkjax-*"))) == 2


def test_scripts_keep_programs_in_the_users_cache_folder(folder, tmp_path, ours, request, monkeypatch):
    """As the command line does; a switch, or None as the folder, keeps nothing. Settings of JAX belong to a program."""
    tree = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}
    request.addfinalizer(functools.partial(jax.config.update, "jax_debug_infs", False))
    jax.config.update("jax_compilation_cache_dir", None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def files(power: int) -> int:
        assert float(make([])(tree, power=power)["sum"]) == 3.0**power + 1
        return len(list((tmp_path / "linkjax").glob("linkjax-*")))

    assert files(2) == files(2) == 1
    with monkeypatch.context() as patch:
        patch.setenv("LINKJAX_CACHE", "off")
        assert files(3) == 1
        patch.delenv("LINKJAX_CACHE")
        _compile.keep_in(None)
        assert files(4) == 1
        patch.setattr(_compile, "_KEPT", [])
        jax.config.update("jax_debug_infs", True)
        assert files(2) == 2


def test_damaged_files_are_replaced(folder, ours):
    tree, traced = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, []
    make(traced)(tree, power=2)
    (file,) = folder.glob("linkjax-*")
    file.write_bytes(b"nonsense")
    assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert len(traced) == 2
    assert len(file.read_bytes()) > 100


def test_inside_transformations_it_is_a_plain_jit(folder, ours):
    raised = make([])
    slope = jax.grad(lambda a: raised({"a": a, "b": jnp.asarray(1.0)}, 2)["sum"])(jnp.asarray(3.0))
    assert float(slope) == 6.0
    assert list(folder.glob("linkjax-*")) == []


def test_callbacks_into_python_are_not_kept(folder, ours):
    seen = []

    @_compile.compiled_soon
    def told(x):
        jax.debug.callback(lambda x: seen.append(float(x)), x)
        return 2 * x

    assert float(told(jnp.asarray(4.0))) == 8.0
    jax.effects_barrier()
    assert seen == [4.0]
    assert list(folder.glob("linkjax-*")) == []


def test_a_kept_program_that_does_not_run_is_made_anew(folder, ours):
    """The file is intact, but the executable inside is another one."""
    tree, traced = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, []
    make(traced)(tree, power=2)
    (file,) = folder.glob("linkjax-*")
    (payload, *rest), shapes = pickle.loads(file.read_bytes())
    file.write_bytes(pickle.dumps(((payload[:-100], *rest), shapes)))
    assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert traced == [2, 2]
    assert float(make(traced)(tree, power=2)["sum"]) == 10.0
    assert traced == [2, 2]


def test_never_read_from_jaxs_own_cache(folder, ours, monkeypatch):
    """An executable compiled by another process cannot be written again completely."""
    names, compiled = [], _compile.compiled_sooner

    def seen(lowered, options=None):
        names.append(lowered.as_text().split("@", 1)[1].split()[0])
        return compiled(lowered, options)

    monkeypatch.setattr(_compile, "compiled_sooner", seen)
    for _ in range(2):
        make([])({"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, power=2)
        (file,) = folder.glob("linkjax-*")
        file.unlink()
    assert len(set(names)) == 2


def test_compiled_ahead_from_shapes(tmp_path, ours):
    """A chain of two: the second compiles before the first has run, neither is traced again, and both are stored."""
    traced, x = [], {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}
    _compile.keep_in(tmp_path)
    for _ in range(2):  # the second time as in a new process
        one, two = make(traced), make(traced)
        shapes = one.ahead(x, 2)
        assert shapes == {"sum": jax.ShapeDtypeStruct((), jnp.float64), "none": None}
        two.ahead({"a": shapes["sum"], "b": x["b"]}, power=3)
        assert traced == [2, 3]
        assert float(two({"a": one(x, 2)["sum"], "b": x["b"]}, 3)["sum"]) == 1001.0
        assert traced == [2, 3]


def test_what_fails_to_compile_says_so():
    @_compile.compiled_soon
    def wrong(x):
        return x + jnp.ones((2, 3, 4))

    with pytest.raises((TypeError, ValueError)):
        wrong(jnp.ones(7))


def test_options_that_xla_no_longer_knows(monkeypatch):
    monkeypatch.setattr(_compile, "SOONER", {"xla_of_tomorrow": True, **_compile.SOONER})
    assert float(_compile.compiled_soon(lambda x: 2 * x)(jnp.asarray(4.0))) == 8.0


def test_what_users_write_is_never_kept(folder):
    """Neither a function, whose closure and source a file name does not determine, nor a tree of a class of theirs."""
    assert [float(_compile.compiled_soon(lambda x, k=k: k * x)(jnp.asarray(1.0))) for k in (2, 3, 4)] == [2, 3, 4]
    assert list(folder.glob("*")) == []

    class Drag(lj.OpposingForce):
        pass

    scene = lj.load("slider-crank")
    own = dataclasses.replace(scene, loads=(Drag("drag", "piston", "P", magnitude=1.0),))
    kept = [_compile._ours(reduced_model, jax.tree.structure({"scene": s})) for s in (scene, own)]
    assert kept == [True, False]
    assert not _compile._ours(scene.with_mechanism, jax.tree.structure(scene))  # a method depends on more than its name


def test_called_first_during_tracing():
    """What is remembered of arrays is not that of the tracers."""
    _compile._at_hand.cache_clear()
    doubled = _compile.compiled_soon(lambda x: 2 * x)
    assert float(jax.jit(lambda x: doubled(x) + doubled(2 * x))(jnp.asarray(4.0))) == 24.0
    assert float(doubled(jnp.asarray(4.0))) == 8.0


def test_arrays_on_another_device():
    """As they come out of a population: put on the first device."""
    doubled = _compile.compiled_soon(lambda x: 2 * x)
    for device in jax.devices():
        assert float(doubled(jax.device_put(jnp.asarray(4.0), device))) == 8.0


def test_what_failed_once_may_work_later(monkeypatch):
    """Compilation may fail when memory is short."""
    doubled = _compile.compiled_soon(lambda x: 2 * x)

    def fail(*_):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(_compile, "compiled_sooner", fail)
        with pytest.raises(MemoryError):
            doubled(jnp.asarray(4.0))
    assert float(doubled(jnp.asarray(4.0))) == 8.0


def test_programs_go_with_their_function():
    kept = _compile.compiled_soon(lambda x: 2 * x)
    assert kept in _compile._MADE
    gone = weakref.ref(kept)
    del kept
    gc.collect()
    assert gone() is None


def test_a_folder_that_cannot_be_written(tmp_path, ours):
    """No files remain, and nothing fails."""
    _compile.keep_in(tmp_path)
    (tmp_path / "taken").mkdir()
    _compile._write(tmp_path / "taken", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
    _compile._delete(tmp_path / "taken")
    assert float(make([])({"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, 2)["sum"]) == 10.0


def test_a_damaged_file_that_cannot_be_deleted(folder, ours, monkeypatch):
    """In a folder shared by several users: compiled again nevertheless, and only once."""
    tree, traced = {"a": jnp.asarray(3.0), "b": jnp.asarray(1.0)}, []
    make(traced)(tree, power=2)
    (file,) = folder.glob("linkjax-*")
    (payload, *rest), shapes = pickle.loads(file.read_bytes())
    bad = pickle.dumps(((payload[:-100], *rest), shapes))
    file.write_bytes(bad)
    monkeypatch.setattr(_compile, "_delete", lambda file: None)
    monkeypatch.setattr(_compile, "_write", lambda file, content: None)
    again = make(traced)
    assert [float(again(tree, power=2)["sum"]) for _ in range(2)] == [10.0, 10.0]
    assert traced == [2, 2]
    assert file.read_bytes() == bad


ALONE = """
import sys, jax, jax.numpy as jnp
from linkjax import _compile
jax.config.update("jax_compilation_cache_dir", sys.argv[1])
_compile._ours = lambda function, tree: True
@_compile.compiled_soon
def solved(a, b):
    return jnp.linalg.solve(a, b)
print(solved(jnp.diag(jnp.asarray([2.0, 4.0])), jnp.ones(2)))
"""


def test_linear_algebra_in_a_program_that_is_read_first(tmp_path):
    """In a process that has not lowered any."""
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", ALONE, str(tmp_path)], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (0, "[0.5  0.25]\n")
    assert len(list(tmp_path.glob("linkjax-*"))) == 1


@pytest.fixture
def made(monkeypatch) -> list[str]:
    """Names of the functions for which a program is read or compiled from now on."""
    found: list[str] = []
    program = _compile._program
    monkeypatch.setattr(
        _compile, "_program", lambda function, *rest: found.append(function.__name__) or program(function, *rest)
    )
    return found


def test_other_numbers_and_another_title_compile_nothing(made):
    """Neither analyses nor problems: bounds, starts and numbers of the scene are arguments of the programs."""
    scene = lj.load("slider-crank")
    free = {"links.rod.length": ("0.15 m", "0.35 m")}
    lj.analyse(scene, angles=24, nodes=24)
    lj.optimise(scene, free, "mean_drive_torque", nodes=24)
    made.clear()
    other = eqx.tree_at(lambda s: s.speed, dataclasses.replace(scene, title="Another one"), jnp.asarray(20.0))
    lj.analyse(other, angles=24, nodes=24)
    lj.optimise(other, {"links.rod.length": ("0.16 m", "0.3 m")}, "mean_drive_torque", nodes=24, seed=3, starts=2)
    assert made == []


OTHERS = {"rod": "n1", "piston": "alpha", "O": "zero", "C": "B", "P": "A", "gas": "pull"}


def test_other_names_compile_nothing(made, tmp_path):
    """Analyses, measures and problems; whatever the alphabetical order of the names."""
    text = (Path(lj.scenes.__file__).parent / "builtin" / "slider-crank.toml").read_text()
    for old, new in OTHERS.items():
        text = re.sub(rf'(?<=["\.]){old}(?=["\]])|^{old}(?= = \[)', new, text, flags=re.M)
    (tmp_path / "other.toml").write_text(text)
    scene, other = lj.load("slider-crank"), lj.load(tmp_path / "other.toml")
    assert set(other.mechanism.links) == {"crank", "n1", "alpha"}
    one = lj.analyse(scene, angles=24, nodes=24)
    slope = lj.measures.peak_reaction(scene, 24)
    best = lj.optimise(scene, {"links.rod.length": (0.15, 0.35)}, "mean_drive_torque", nodes=24)
    assert made
    made.clear()
    two = lj.analyse(other, angles=24, nodes=24)
    np.testing.assert_allclose(lj.measures.peak_reaction(other, 24), slope, rtol=1e-14)
    same = lj.optimise(other, {"links.n1.length": (0.15, 0.35)}, "mean_drive_torque", nodes=24)
    assert made == []
    assert two.scene.mechanism.link_names == other.mechanism.link_names
    np.testing.assert_allclose(same.x, best.x, rtol=1e-14)
    assert all(name not in str(same) for name in ("<0", "rod"))
    ours, theirs = one.table(), two.table()
    assert len(ours) == len(theirs) > 50
    for name, column in ours.items():
        as_other = "_".join(OTHERS.get(part, part) for part in name.split("_"))
        as_other = as_other.replace("piston.guide", "alpha.guide")
        np.testing.assert_allclose(theirs[as_other], column, rtol=1e-12, atol=1e-12 * np.max(np.abs(column)))
    for name, peak in zip(peak_names(scene), one.peaks.value, strict=True):
        as_other = ".".join(OTHERS.get(part, part) for part in name.split("."))
        np.testing.assert_allclose(two.peaks.value[peak_names(other).index(as_other)], peak, rtol=1e-12)


def test_strings_in_structures_are_names_or_choices():
    """A new field that is a string in a group, load or link is a name unless it is listed as a choice."""
    rooms = (lj.groups, lj.mechanism, lj.loads, lj.friction)
    classes = {c for room in rooms for c in vars(room).values() if isinstance(c, type) and dataclasses.is_dataclass(c)}
    names = {"link", "links", "block", "blocks", "from_", "to", "end", "meet", "about", "pivot", "centre", "carrier"}
    names |= {
        "through",
        "on",
        "at",
        "members",
        "outer",
        "link_names",
        "centre_name",
        "pins",
        "name",
        "point",
        "ends",
        "uniform",
        "to_link",
        "to_point",
    }
    kinds = ("str", "Literal", "Rotation", "Mass", "Shape")
    static = (field for each in classes for field in dataclasses.fields(each) if field.metadata.get("static"))
    texts = {field.name for field in static if any(kind in str(field.type) for kind in kinds)}
    assert texts - names <= CHOICES
    assert texts & CHOICES == CHOICES - {"mean", "title"}  # of the scene


def test_progress_counts_the_programs():
    function = _compile.compiled_soon(lambda x: x + 1.0)
    function(jnp.zeros(()))
    done, count = _compile.progress()
    function.programs["waiting"] = _compile.Program(Future(), None, None, None)
    assert _compile.progress() == (done, count + 1)


def test_a_program_without_arrays_is_one_of_its_precision():
    """Its arguments do not say in which precision it computes."""
    third = _compile.compiled_soon(lambda name: jnp.ones(()) / 3, static=("name",))
    for wide in (True, False, True):
        with jax.enable_x64(wide):
            assert third(name="a").dtype == (jnp.float64 if wide else jnp.float32)
