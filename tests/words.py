"""The words that the project does not use, and where they are found.

    python -m tests.words [path ...]

prints every place. `tests/test_words.py` keeps them out of messages, docstrings, comments, and docs.
"""

from __future__ import annotations

import io
import json
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SCANNED = ("linkjax", "docs", "studies", "benchmarks", "notebooks", "README.md")
KINDS = {".py", ".md", ".toml", ".ipynb", ".json", ".js"}
PROSE = {"STRING", "COMMENT", "FSTRING_MIDDLE"}

# what is not written: what is written instead
WORDS = {
    r"(comes?|coming|came) round": "rotates fully; cannot rotate fully",
    r"told|tells?|telling": "is reported, shows, says",
    r"lost": "cannot be assembled",
    r"milliard(th)?s?": "1e9, 1e-9",
    r"(an|one |the )other assembly(?! mode)|assemblies": "assembly modes (coincide)",
    r"(left|stays?|leaves?) open": "closure error",
    r"dead positions?": "singular (toggle) position",
    r"dead points?": "dead centre, limit position, singular position",
    r"(derivatives?|gradients?|slopes?) by(?= (the|a|its|all|every|x|φ|crank|lengths?|angle))": "with respect to",
    r"wheels?": "gear, pulley",
    r"in gear": "in mesh",
    r"idlers?": "free gear",
    r"teeth (outside|inside)": "external, internal gears",
    r"comes? out( only)? (together|after)": "are coupled and solved simultaneously",
    r"repeats? nothing|nothing repeats|where (it|they) (began|begin)": "is not periodic; returns to its start",
    r"hold(s|ing)? (each other )?fast|loose(ly)?": "overconstrained; unconstrained",
    r"passive (links?|blocks?|groups?|ones?)": "redundant link (passive constraint)",
    r"equilibrium (alone )?does not tell": "statically indeterminate",
    r"general groups?": "group of higher class (solved numerically)",
    r"h[au]ngs? (on|from)|hanging|br(ing|ings|ought)( \w+){0,3} in": "is attached to; introduces",
    r"behind the (one|ones)": "after the one",
    r"(marked|further) points?": "coupler point, additional point",
    r"(that|it|which|to|not|or) swings?(?! (of|over|about))|swinging": "oscillates",
    r"stands? (at|for|where)|standing at": "is at",
    r"periodic regimes?|true motion": "steady-state motion; actual (varying-speed) motion",
    r"free numbers?|numbers? of (the|a) scene": "design variable; scene parameter",
    r"own (jax )?functions?|functions? of (your|one's|his) own": "user-defined function",
    r"today('s)?": "initial (baseline) value",
    r"tied|un?tied|ties": "equal peaks; linked variables",
    r"giv(e|es|en|ing) way|clash(es|ing)?|crowds?": "is relaxed; conflicting constraints; batch of starts",
    r"a text|texts|whole numbers?|blanks?": "string, integer, space",
    r"(leav(e|es|ing)|left) (it |them |that |these |this )?out|leave out": "omit",
    r"as (it|they) (was|were) drawn": "original design",
    r"rooms?|roads?": "subpackage, method",
    r"lent|lends?": "provided by",
    r"so many times as": "speed-up",
}
PATTERN = re.compile(r"(?<![\w.`-])(" + "|".join(f"(?:{word})" for word in WORDS) + r")(?![\w`=(])", re.IGNORECASE)
CODE = re.compile(r"`[^`\n]*`|\"[a-z_.\[\]0-9]*\"")

# where a word has another meaning, or a rule does not hold: file, and the part of the line that may stay
ALLOWED: dict[str, tuple[str, ...]] = {
    "docs/architecture.md": ("room", "rooms", "road", "roads"),
}


def prose_of(path: Path) -> Iterator[tuple[int, str]]:
    """Line numbers and lines of a file that people read, without what is code in them."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if tokenize.tok_name[token.type] in PROSE:
                yield from enumerate(token.string.splitlines(), token.start[0])
    elif path.suffix == ".ipynb":
        for cell in json.loads(text)["cells"]:
            yield from ((0, line) for line in cell["source"])
    elif path.suffix == ".toml":
        yield from ((i, line.partition("#")[2]) for i, line in enumerate(text.splitlines(), 1))
    else:
        yield from enumerate(text.splitlines(), 1)


def found_in(path: Path) -> Iterator[str]:
    """Every place of a file where one of the words is, with what to write."""
    name = path.resolve().relative_to(ROOT).as_posix()
    for number, line in prose_of(path):
        plain = CODE.sub(" ", line)
        for match in PATTERN.finditer(plain):
            word = match[1]
            if any(word.lower() in allowed.lower() and allowed in line for allowed in ALLOWED.get(name, ())):
                continue
            instead = next(new for old, new in WORDS.items() if re.fullmatch(old, word, re.IGNORECASE) or
                           re.match(old, plain[match.start(1):], re.IGNORECASE))  # fmt: skip
            yield f"{name}:{number}: {word!r}: write {instead!r}: {line.strip()[:100]}"


def files(paths: list[Path]) -> Iterator[Path]:
    """The files that are read by people, below some paths."""
    for path in paths:
        every = [path] if path.is_file() else sorted(path.rglob("*"))
        yield from (file for file in every if file.suffix in KINDS and "__pycache__" not in file.parts)


if __name__ == "__main__":
    asked = [Path(each) for each in sys.argv[1:]] or [ROOT / each for each in SCANNED]
    places = [place for file in files(asked) for place in found_in(file)]
    print("\n".join([*places, f"{len(places)} places"]))
