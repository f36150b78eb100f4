"""Strict JAX for every test: float64, no silent promotion, two CPU devices, compiled programs are kept.

linkjax itself must not be imported here: a hook that acts on import checks its annotations.
"""

import gc
import importlib.metadata
import os
import sys
import zlib
from collections.abc import Callable, Generator
from pathlib import Path

CACHE = Path(__file__).parents[1] / ".cache"
MOST_MAPS = 15_000  # of the 65 530 that Linux allows; about 5 GB of programs
os.environ["XDG_CACHE_HOME"] = str(CACHE)  # also for programs started by tests: nothing is written elsewhere
os.environ["MPLBACKEND"] = "agg"
# a test runs for milliseconds what it compiles for seconds; XLA stops at a flag that it does not know
SOONER = ["--xla_backend_optimization_level=0", "--xla_cpu_parallel_codegen_split_count=1"]
if tuple(map(int, importlib.metadata.version("jaxlib").split(".")[:2])) < (0, 11):
    SOONER.append("--xla_cpu_use_fusion_emitters=false")
os.environ.setdefault("XLA_FLAGS", " ".join(SOONER))
gc.set_threshold(100_000, 20, 20)  # tracing creates millions of lasting objects: scanning them took a tenth of the time

import jax  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402

TOLD = pytest.StashKey[list[str]]()

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_num_cpu_devices", 2)
jax.config.update("jax_compilation_cache_dir", str(CACHE / "jax"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, so that no worker remains busy alone at the end."""
    longest = (
        "test_measures.py",
        "test_delta_error.py",
        "test_docs.py",
        "test_locking.py",
        "01_hay_press.ipynb",
        "test_families.py",
        "test_runs.py",
        "test_browser.py",
        "test_friction.py",
        "test_report.py",
    )
    items.sort(key=lambda item: longest.index(item.path.name) if item.path.name in longest else len(longest))


@pytest.fixture(scope="session")
def tell(pytestconfig: pytest.Config) -> Callable[..., None]:
    """Collects lines to print at the end of the run, from all processes."""
    return lambda *lines: pytestconfig.stash.setdefault(TOLD, []).extend(lines)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """The collected lines are sent with the next report."""
    report = yield
    told = item.config.stash.get(TOLD, [])
    report.user_properties += [("told", line) for line in told]
    told.clear()
    return report


def pytest_terminal_summary(terminalreporter) -> None:
    """The collected lines; one line if the tests of the page had no browser."""
    reports = [report for each in terminalreporter.stats.values() for report in each]
    for what, line in (pair for report in reports for pair in getattr(report, "user_properties", ())):
        if what == "told":
            terminalreporter.write_line(line)
    skipped = [report for report in terminalreporter.stats.get("skipped", []) if "no browser" in str(report.longrepr)]
    if skipped:
        reason = str(skipped[0].longrepr[2]).removeprefix("Skipped: ")
        terminalreporter.write_line(f"{len(skipped)} tests of the report's page were skipped, {reason}")


@pytest.fixture(autouse=True)
def few_programs():
    """Compiled programs are dropped before the process reaches its limit of memory maps."""
    yield
    maps = Path("/proc/self/maps")
    compiler = sys.modules.get("linkjax._compile")
    if compiler is not None and maps.exists() and maps.read_bytes().count(b"\n") > MOST_MAPS:
        compiler.forget()


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Random numbers that depend only on the name of the test."""
    return np.random.default_rng(zlib.crc32(request.node.name.encode()))
