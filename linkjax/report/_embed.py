"""Figures embedded in the page."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

DROPPED = {"metadata", "style"}
REFERENCE = re.compile(r"url\(#([^)]+)\)")
LONG = re.compile(r"-?\d+\.\d{3,}")
GROUP = re.compile(r"(before|hodograph|crank)-[\d-]+|before-key-[\d-]+")


def inline_svg(text: str, name: str, title: str) -> str:
    """An SVG document as an element of an HTML page, without namespaces and metadata, its ids prefixed by its name.

    The element scales with the page, up to 1.6 px per point of its width. Coordinates are rounded to 0.01 point. Groups
    named by `linkjax.viz` get the attributes that the script of the page needs: a class for curves of the earlier
    design and for hodographs; for panels over the crank angle the box of the panel, `data-panel` (left, top, right,
    bottom), and the crank angle (degrees) at its right edge, `data-end`. Raises `ParseError` for invalid XML.
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
    """Set class and data attributes of a group that the script of the page uses."""
    found = GROUP.fullmatch(name)
    if found is None:
        return
    kind = name.partition("-")[0]
    if kind != "crank":
        element.set("class", kind)
        return
    outline = next((path.get("d", "") for path in element.iter() if _local(path.tag) == "path"), "")
    numbers = [float(number) for number in re.findall(r"-?[\d.]+", outline)]
    if len(numbers) >= 8:  # matplotlib draws the background rectangle of the panel first
        xs, ys = numbers[0:8:2], numbers[1:8:2]
        element.set("data-panel", " ".join(f"{edge:.2f}" for edge in (min(xs), min(ys), max(xs), max(ys))))
        element.set("data-end", name.split("-")[1])


def _local(name: str) -> str:
    """A name without namespace."""
    return name.rpartition("}")[2]
