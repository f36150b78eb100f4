"""Names that scene files can hold, for those of other programs that they cannot."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable

USABLE = r"[^\W\d_][\w-]{0,39}"  # as scene files have it
LONGEST = 40


class Names:
    """Usable names, each given once."""

    def __init__(self, kept: Iterable[str]):
        self.taken = {"frame", *(name for name in kept if usable(name))}

    def all(self, names: Iterable[str], letter: str, suffix: str, kept: Iterable[str]) -> dict[str, str]:
        """Each of these with its usable name: itself where it is one of those that are `kept`, or else a new one."""
        kept = {name for name in kept if usable(name) and name != "frame"}
        return {name: name if name in kept else self.new(name, letter, suffix) for name in names}

    def new(self, name: str, letter: str, suffix: str = "") -> str:
        """The nearest usable name that is still free: it begins with `letter` where this one begins with none, and ends
        with `suffix`, or else with a number, where the name alone is taken."""
        plain = re.sub(r"[^\w-]+", "_", name)
        plain = plain if re.match(r"[^\W\d_]", plain) else letter + plain
        ends = itertools.chain(dict.fromkeys(("", suffix)), (f"{suffix}_{i}" for i in itertools.count(2)))
        found = next(name for end in ends if (name := plain[: LONGEST - len(end)] + end) not in self.taken)
        self.taken.add(found)
        return found


def usable(name: str) -> bool:
    """Whether a scene file can hold this name."""
    return re.fullmatch(USABLE, name) is not None
