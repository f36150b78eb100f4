"""Thousands of random versions of the built-in scenes: each is read, or refused in one line that names the file."""

import tomllib

import pytest

from linkjax.scenes import SceneError, build_problem, build_rolling, loads_text, read_document, sketched_keys
from linkjax.scenes._located import REPORT
from tests.scenes.fuzz import mutant

FILE = "bad.toml"


def read(text: str) -> None:
    """What `load`, `load_rolling`, `load_problem` and the commands do with the text of a file."""
    document = read_document(text, FILE)
    if document.rolling:
        build_rolling(document)
        return
    loads_text(text, FILE)
    if "optimise" in document.table:
        build_problem(document)
    sketched_keys(document.table)


def fault(text: str) -> str:
    """What is wrong with the answer to a text; nothing where it is read, or refused as it should be."""
    try:
        read(text)
    except SceneError as error:
        message = str(error)
        if not message.startswith(f"{FILE}: "):
            return f"the file is not named: {message}"
        if len(message) >= 500 or len(message.splitlines()) != 1:
            return f"not one line of less than 500 characters: {message!r}"
        return f"an error that no message of linkjax explains: {message}" if error.remedy == REPORT else ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def check(first: int, count: int) -> None:
    """Read so many mutants; fails with seed and text of those that are answered wrongly."""
    wrong = [(seed, found) for seed in range(first, first + count) if (found := fault(mutant(seed)))]
    shown = [f"seed {seed}: {found}\n{mutant(seed)}" for seed, found in wrong[:3]]
    assert not wrong, f"{len(wrong)} of {count} mutants\n" + "\n".join(shown)


@pytest.mark.slow
def test_a_thousand_mutants():
    check(0, 1000)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 101_000, 10_000))
def test_a_hundred_thousand_mutants(first):
    check(first, 10_000)


def test_mutants_repeat_and_differ():
    """A seed is one text; of a hundred some are read, some are no TOML, and most are refused."""
    texts = [mutant(seed) for seed in range(100)]
    assert texts == [mutant(seed) for seed in range(100)] and len(set(texts)) > 90
    broken = 0
    for text in texts:
        try:
            tomllib.loads(text)
        except tomllib.TOMLDecodeError:
            broken += 1
    assert 5 < broken < 60
