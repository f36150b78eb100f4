"""Shared parts of the tests of exported machines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # only tests import linkjax
    from tests.exchange.mujoco_road import Apart


@pytest.fixture(scope="module")
def figures():
    """Collects the differences to MuJoCo, and prints the largest (seen with `pytest -s`)."""
    found: dict[str, Apart] = {}
    yield found
    if found:
        far, strong = (max(found, key=lambda name, which=which: found[name][which]) for which in range(2))
        print(f"\n{len(found)} machines in MuJoCo: positions within {found[far].position:.1e} ({far}), "
              f"drive torque within {found[strong].torque:.1e} ({strong})")  # fmt: skip


@pytest.fixture
def call(monkeypatch, capsys):
    """Exit code, standard output and standard error of a command."""

    from linkjax import cli

    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["linkjax", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        return stopped.value.code or 0, *capsys.readouterr()

    return run
