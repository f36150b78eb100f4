"""Figures put into the page itself."""

from __future__ import annotations

import base64
import re
import xml.etree.ElementTree as ET
from pathlib import Path

DROPPED = {"metadata", "style"}
REFERENCE = re.compile(r"url\(#([^)]+)\)")


def inline_svg(path: Path, title: str) -> str:
    """An SVG file as an element of an HTML page: no namespaces, no metadata, its ids prefixed by the file's name.

    It scales with the page and never beyond its own width. Raises `OSError` or `ParseError` when it cannot be read.
    """
    root = ET.parse(path).getroot()
    prefix = re.sub(r"\W", "-", path.stem) + "-"
    _clean(root, prefix)
    width = root.attrib.pop("width", "")
    root.attrib.pop("height", None)
    root.attrib.pop("version", None)
    root.attrib |= {"role": "img", "aria-label": title}
    if re.fullmatch(r"[\d.]+pt", width):
        root.set("style", f"max-width:{width}")
    return ET.tostring(root, encoding="unicode")


def _clean(element: ET.Element, prefix: str) -> None:
    element.tag = _local(element.tag)
    for name, value in list(element.attrib.items()):
        del element.attrib[name]
        local = _local(name)
        if local == "id":
            value = prefix + value
        elif local == "href" and value.startswith("#"):
            value = f"#{prefix}{value[1:]}"
        elif local == "type":
            continue
        element.set(local, REFERENCE.sub(rf"url(#{prefix}\1)", value))
    for child in list(element):
        if not isinstance(child.tag, str) or _local(child.tag) in DROPPED:
            element.remove(child)
        else:
            _clean(child, prefix)


def _local(name: str) -> str:
    """A name without its namespace."""
    return name.rpartition("}")[2]


def data_uri(path: Path) -> str:
    """A GIF or PNG file as a data URI."""
    kind = {".gif": "image/gif", ".png": "image/png"}[path.suffix.lower()]
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
