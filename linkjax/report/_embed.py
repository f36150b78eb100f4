"""Figures put into the page itself."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

DROPPED = {"metadata", "style"}
REFERENCE = re.compile(r"url\(#([^)]+)\)")
LONG = re.compile(r"-?\d+\.\d{3,}")
GROUP = re.compile(r"(before|hodograph|crank)-[\d-]+|before-key-[\d-]+")


def inline_svg(text: str, name: str, title: str) -> str:
    """An SVG document as an element of an HTML page: no namespaces, no metadata, its ids prefixed by its name.

    It scales with the page and never beyond its own width. Coordinates are rounded to a hundredth of a point. What
    `linkjax.viz` marked by names gets what the page's own program looks for: curves of the machine before and
    hodographs their class, and panels over the crank angle the place of their box, `data-panel` (left, top, right,
    bottom), with the crank angle (degrees) at which they end, `data-end`. Raises `ParseError` for what is no SVG.
    """
    root = ET.fromstring(text)
    _clean(root, re.sub(r"\W", "-", name) + "-")
    width = root.attrib.pop("width", "")
    root.attrib.pop("height", None)
    root.attrib.pop("version", None)
    root.attrib |= {"role": "img", "aria-label": title}
    if re.fullmatch(r"[\d.]+pt", width):
        root.set("style", f"max-width:{1.6 * float(width[:-2]):g}px")
    return ET.tostring(root, encoding="unicode")


def _clean(element: ET.Element, prefix: str) -> None:
    element.tag = _local(element.tag)
    for name, value in list(element.attrib.items()):
        del element.attrib[name]
        local = _local(name)
        if local == "id":
            _mark(element, value)
            value = prefix + value
        elif local == "href" and value.startswith("#"):
            value = f"#{prefix}{value[1:]}"
        elif local == "type":
            continue
        elif local in ("d", "x", "y", "transform"):
            value = " ".join(LONG.sub(lambda match: f"{float(match[0]):.2f}", value).split())
        element.set(local, REFERENCE.sub(rf"url(#{prefix}\1)", value))
    for child in list(element):
        if not isinstance(child.tag, str) or _local(child.tag) in DROPPED:
            element.remove(child)
        else:
            _clean(child, prefix)


def _mark(element: ET.Element, name: str) -> None:
    """Class and data of a group that the page's program works on."""
    found = GROUP.fullmatch(name)
    if found is None:
        return
    kind = name.partition("-")[0]
    if kind != "crank":
        element.set("class", kind)
        return
    outline = next((path.get("d", "") for path in element.iter() if _local(path.tag) == "path"), "")
    numbers = [float(number) for number in re.findall(r"-?[\d.]+", outline)]
    if len(numbers) >= 8:  # the rectangle that matplotlib draws first: the panel's background
        xs, ys = numbers[0:8:2], numbers[1:8:2]
        element.set("data-panel", " ".join(f"{edge:.2f}" for edge in (min(xs), min(ys), max(xs), max(ys))))
        element.set("data-end", name.split("-")[1])


def _local(name: str) -> str:
    """A name without its namespace."""
    return name.rpartition("}")[2]
