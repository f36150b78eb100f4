"""Which link each point of a list of groups belongs to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from linkjax.groups import FRAME, AbstractGroup


def owners(fixed: Iterable[str], groups: Sequence[AbstractGroup], links: Mapping[str, Any]) -> dict[str, str]:
    """The link that each point belongs to: "frame", or the link that introduced the point."""
    owner = dict.fromkeys(fixed, FRAME)
    for group in groups:
        new = group.brings()
        owner |= {pin: link for pin, link in group.shared().items() if link}
        for link, ends in group.pins().items():
            for pin in ends:
                if pin in new:
                    owner.setdefault(pin, link)
        for link in group.link_names():
            for point in (*links[link].point_names(), *links[link].counterweights, links[link].centre_name):
                owner.setdefault(point, link)
    return owner


def origins(groups: Sequence[AbstractGroup]) -> dict[str, str]:
    """The point at the origin of each link's axes."""
    return {link: first for group in groups for link, (first, _) in group.pins().items()}
