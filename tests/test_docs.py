"""Documentation that stays correct: examples run, links lead to pages, named objects exist."""

import doctest
import importlib
import re
import shlex
import tomllib
from pathlib import Path

import pytest

import linkjax
from linkjax.cli._help import PAGE, SECTIONS, more
from linkjax.groups import KINDS
from linkjax.measures import FAMILIES, MEASURES
from linkjax.topology import KINDS_OF_II
from tests.helpers import PACKAGE, ROOT
from tests.test_cli import run

LONGEST = 1500  # words of a page without contents
LISTS = ("CHANGELOG.md",)  # in the order of versions
FOLDERS = ("docs", "studies", "notebooks")
PAGES = sorted([*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.md"))])


def name(path):
    return path.relative_to(ROOT).as_posix()


def blocks(path, language):
    """Fenced blocks in one language, each padded so that line numbers are those of the page."""
    text = path.read_text(encoding="utf-8")
    for found in re.finditer(rf"^```{language}\n(.*?)^```", text, re.M | re.S):
        yield "\n" * text[: found.start(1)].count("\n") + found[1]


def written(block: str) -> None:
    """Write a TOML block that begins with `# NAME.toml`, or `# added to NAME.toml`, to the present folder."""
    if found := re.match(r"# (added to )?(\S+\.toml)\n", block.lstrip()):
        with Path(found[2]).open("a" if found[1] else "w", encoding="utf-8") as file:
            file.write(block.lstrip().removeprefix(found[0]))


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_python_blocks_run(path, tmp_path, monkeypatch):
    """The Python blocks of a page, one after the other as one program."""
    monkeypatch.chdir(tmp_path)
    for block in blocks(path, "toml"):
        written(block)
    program: dict = {}
    for block in blocks(path, "python"):
        exec(compile(block, str(path), "exec"), program)


def commands(block: str) -> list[tuple[str, list[str]]]:
    """The commands of a console block, each with the lines that it prints."""
    found: list[tuple[str, list[str]]] = []
    for line in block.strip("\n").split("\n"):
        if line.startswith("$ "):
            found.append((line[2:].split("  #")[0], []))
        else:
            found[-1][1].append(line.rstrip())
    return found


def like(lines: list[str]) -> str:
    """A pattern of printed lines, of which `…` stands for any number."""
    return "".join(r"(?:.*\n)*?" if line == "…" else re.escape(line) + "\n" for line in lines)


COMMANDED = [path for path in PAGES if "\n$ linkjax " in path.read_text(encoding="utf-8")]
LONG = ("docs/optimise.md",)


@pytest.mark.parametrize(
    "path", [pytest.param(p, id=name(p), marks=[pytest.mark.slow] * (name(p) in LONG)) for p in COMMANDED]
)
def test_commands_print_what_the_page_shows(path, tmp_path, monkeypatch, capsys):
    """The commands of a page, one after the other, with the files that it shows."""
    monkeypatch.chdir(tmp_path)
    for found in re.finditer(r"^```(toml|console)\n(.*?)^```", path.read_text(encoding="utf-8"), re.M | re.S):
        if found[1] == "toml":
            written(found[2])
            continue
        for command, shown in commands(found[2]):
            if not command.startswith("linkjax "):
                continue
            words, _, file = command.partition(" > ")
            code, out, err = run(monkeypatch, capsys, *shlex.split(words)[1:])
            assert code == 0, err
            if file:
                Path(file).write_text(out, encoding="utf-8")
            out = "".join(f"{line.rstrip()}\n" for line in out.rstrip("\n").split("\n"))
            assert not shown or re.fullmatch(like(shown), out), f"{command} printed\n{out}"


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_toml_blocks_parse(path):
    for block in blocks(path, "toml"):
        tomllib.loads(block)


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_links_lead_somewhere(path):
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    targets = [t.split("#")[0] for t in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in t and t[0] != "#"]
    assert [t for t in targets if not (path.parent / t).exists()] == []


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_long_pages_have_contents(path):
    """A page of more than 1500 words begins with links to its sections."""
    text = path.read_text(encoding="utf-8")
    sections = re.findall(r"^## (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S), re.M)
    linked = re.findall(r"\[([^]]+)\]\(#[^)]+\)", text.split("\n## ")[0])
    assert len(text.split()) <= LONGEST or path.name in LISTS or set(sections) <= set(linked)


def test_named_make_targets_exist():
    made = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    for path in PAGES:
        used = re.findall(r"(?:`|\$ )make ([a-z-]+)", path.read_text(encoding="utf-8"))
        assert set(used) <= made, path


def test_every_public_name_has_its_place_in_the_reference():
    text = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs/api").glob("*.md"))
    named = re.findall(r"^::: (linkjax\.\S+)$", text, re.M)
    for path in named:
        module, _, thing = path.rpartition(".")
        assert hasattr(importlib.import_module(module), thing), path
    homes = {f"linkjax.{home}.{name}" for name, home in linkjax._HOMES.items()}
    assert homes - set(named) == set() and len(named) == len(set(named))


def test_the_site_has_every_page():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    apart = {"studies/README.md", "notebooks/README.md"}
    assert {name(path) for path in PAGES} - apart == set(re.findall(r": (\S+\.md)$", text, re.M))


def test_every_kind_of_group_is_in_the_conventions():
    text = (ROOT / "docs/conventions/mechanisms.md").read_text(encoding="utf-8")
    shown = {
        "crank": "I1",
        "linear_driver": "I1",
        "redundant_link": "passive",
        "redundant_slider": "passive",
        **KINDS_OF_II,
    }
    assert [kind for kind in KINDS if f"| `{kind}` | {shown.get(kind, 'G')} |" not in text] == []


def test_docstring_examples():
    for path in PACKAGE.rglob("*.py"):
        if ">>> " in path.read_text(encoding="utf-8"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            module = importlib.import_module(".".join(part for part in parts if part != "__init__"))
            outcome = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
            assert outcome.attempted and not outcome.failed, path


def test_every_measure_is_on_its_page():
    text = (ROOT / "docs/measures.md").read_text(encoding="utf-8")
    assert [m.name for m in MEASURES.values() if f"| `{m.name}` | {m.unit} | " not in text] == []
    for family in FAMILIES.values():
        of = {"": "machine", "joint": "joint and link"}.get(family.of, family.of)
        if family.quantity is None or family.inverse:
            assert f"| `{family.name}` | {family.unit} | {of} | {family.meaning.rstrip('.')} |" in text
        else:
            row = re.search(rf"\| `{family.quantity.name}` \| {re.escape(family.unit)} \| {of} \| (.*?) \|", text)
            assert row and (family.statistic or "–") in [*row[1].split(", "), "–" * (not family.statistic)]


def test_messages_lead_to_their_section():
    """Every section of the page shows a message that leads to it, and every message leads to a section."""
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    sections = re.findall(r"^### (.+)\n\n```text\n(.+)\n```", text, re.M)
    anchors = [re.sub(r"[^a-z0-9 -]", "", title.lower()).replace(" ", "-") for title, _ in sections]
    assert [more(message) for _, message in sections] == [f"see {PAGE}#{anchor}" for anchor in anchors]
    assert {section for _, section in SECTIONS} == set(anchors)
    assert more("something else") == ""
