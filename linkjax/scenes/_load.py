"""What all loads in a scene file have in common."""

from __future__ import annotations

import abc
from collections.abc import Iterator
from typing import Any

from pydantic import Field, StrictBool

from linkjax import loads
from linkjax.scenes._fields import Name, Table
from linkjax.scenes._guides import Fault
from linkjax.scenes._passages import Window, passage

REACTS: Any = Field(None, description="the reaction of the load acts on the frame", examples=["frame"])


class LoadTable(Table, abc.ABC):
    """A load of any kind."""

    name: Name = Field(description="name of the load", examples=["cutting"])
    link: Name = Field(description="the link it acts on", examples=["slider"])
    window: Window | None = Field(
        None,
        description="crank angles [on, off) between which it acts, or a table with the part of a way on which it acts",
        examples=[["90 deg", "335 deg"]],
    )
    useful: StrictBool = Field(
        False, description="its work is what the machine is for, and counts in its efficiency", examples=[True]
    )

    @abc.abstractmethod
    def build(self, cycle_turns: int) -> loads.AbstractLoad:
        """The load itself, in a scene of so many crank turns per cycle."""

    @staticmethod
    @abc.abstractmethod
    def keys_of(load: Any) -> dict[str, Any]:
        """The keys, except name, link, window and useful, that build this load."""

    def faults(self) -> Iterator[Fault]:
        """Contradictions between its keys."""
        yield from ()

    def shared(self) -> dict[str, Any]:
        """The arguments of every kind of load."""
        given = self.window
        window = loads.Window(*given) if isinstance(given, tuple) else None if given is None else passage(given)
        return {"name": self.name, "link": self.link, "window": window}
