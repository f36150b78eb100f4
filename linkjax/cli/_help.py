"""The section of the documentation that says more about a message."""

from __future__ import annotations

import re

PAGE = "docs/troubleshooting.md"
SECTIONS = (  # a pattern of the message, and its section; the first that fits
    (r"no such scene file, nor a built-in scene", "no-such-scene"),
    (r": not valid TOML", "not-valid-toml"),
    (r"not a known key\b", "not-a-known-key"),
    (r": missing; add ", "missing-key"),
    (r"\bgiven twice", "given-twice"),
    (r"an angle without a unit", "angle-without-a-unit"),
    (r"\ban? [a-z ]+ where an? [a-z ]+ is needed|unknown unit|are called rpm", "wrong-unit"),
    (r"cannot (be read as a number|read the unit)|a number without a unit|not a plain number", "wrong-unit"),
    (r"must not be negative", "negative"),
    (r"not a known kind of group", "not-a-kind-of-group"),
    (r"needs a bar with two pins", "length-missing"),
    (r"\bhas no direction; ", "force-without-direction"),
    (r"name '.+' is already used", "name-already-used"),
    (r"is not KEY=VALUE", "not-keyvalue"),
    (r"not one of the choices", "not-a-choice"),
    (r"already exists; ", "the-file-exists"),
    (r"' is not defined; ", "not-defined"),
    (r"' is not on link '", "not-on-the-link"),
    (r"belongs to no group", "in-no-group"),
    (r"has groups, or a drive with links and joints, not both", "groups-or-links-and-joints"),
    (r"degrees? of freedom|nothing can move", "degrees-of-freedom"),
    (r"cannot be assembled|can be assembled at no crank angle", "cannot-be-assembled"),
    (r"has a change point", "change-point"),
    (r"no steady-state motion", "no-steady-state-motion"),
    (r"no actual motion: (nothing has a mass|no reduced inertia)", "no-inertia"),
    (r"friction locks the machine", "locked"),
    (r"No start reached a design that satisfies every constraint", "infeasible"),
    (r"is not a measure; ", "not-a-measure"),
    (r"is not a scene parameter", "not-a-parameter"),
    (r"computes in float32", "float32"),
)


def more(message: str) -> str:
    """Where the documentation says more about a message; "" for one that says all."""
    return next((f"see {PAGE}#{section}" for pattern, section in SECTIONS if re.search(pattern, message)), "")
