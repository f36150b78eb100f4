"""Valid names in scene files for the names of other programs."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable

USABLE = r"[^\W\d_][\w-]{0,39}"  # as in scene files
LONGEST = 40


class Names:
    """Valid names, each used once."""

    def __init__(self, kept: Iterable[str]):
        self.taken = {"frame", *(name for name in kept if usable(name))}

    def all(self, names: Iterable[str], letter: str, suffix: str, kept: Iterable[str]) -> dict[str, str]:
        """The valid name of each name: the same where it is in `kept` and valid, or else a new one."""
        kept = {name for name in kept if usable(name) and name != "frame"}
        return {name: name if name in kept else self.new(name, letter, suffix) for name in names}

    def new(self, name: str, letter: str, suffix: str = "") -> str:
        """The nearest valid name that is not in use. It begins with `letter` where `name` does not begin with a letter,
        and ends with `suffix`, or with a number, where it would be in use without."""
        plain = re.sub(r"[^\w-]+", "_", name)
        plain = plain if re.match(r"[^\W\d_]", plain) else letter + plain
        ends = itertools.chain(dict.fromkeys(("", suffix)), (f"{suffix}_{i}" for i in itertools.count(2)))
        found = next(name for end in ends if (name := plain[: LONGEST - len(end)] + end) not in self.taken)
        self.taken.add(found)
        return found


def usable(name: str) -> bool:
    """Whether a name is allowed in scene files."""
    return re.fullmatch(USABLE, name) is not None
