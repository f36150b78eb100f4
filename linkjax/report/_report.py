"""The page: tables and figures in the order in which a designer reads them."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from linkjax.machine import Scene
from linkjax.report import _tables as tables
from linkjax.report._embed import data_uri, inline_svg
from linkjax.viz import PICTURES

CSS = """
:root { color-scheme: light; --ink: #222; --grey: #666; --line: #d9d9d9; --good: #00664b; --bad: #b02a00; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.2rem 1rem 3rem; max-width: 54rem; color: var(--ink); background: #fff;
  font: 1rem/1.45 "DejaVu Sans", Verdana, "Segoe UI", Helvetica, Arial, sans-serif; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .5rem; padding-bottom: .2rem; border-bottom: 2px solid var(--ink); }
p { margin: .4rem 0; }
.lead, figcaption, caption { color: var(--grey); font-size: .88rem; }
nav { margin: .8rem 0; font-size: .88rem; }
nav a { color: #005a8f; margin-right: .9rem; white-space: nowrap; }
.verdict { padding: .5rem .8rem; border-left: .35rem solid; background: #f5f5f5; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: bold; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .84rem; margin: .4rem 0 .9rem; }
th, td { text-align: left; vertical-align: top; padding: .28rem .55rem; border-bottom: 1px solid var(--line); }
thead th { vertical-align: bottom; border-bottom: 1.5px solid var(--ink); font-weight: 600; }
tbody th { font-weight: normal; min-width: 6.5rem; }
td.good, td.bad { white-space: nowrap; }
.n { text-align: right; }
td.n { white-space: nowrap; font-variant-numeric: tabular-nums; }
figure { margin: 1.4rem 0; }
figure svg, figure img { display: block; width: 100%; height: auto; margin: 0 auto; }
figure img { max-width: 500px; }
figcaption { margin-top: .3rem; text-align: center; }
svg * { stroke-linejoin: round; stroke-linecap: butt; }
@media screen and (max-width: 40rem) {
  body { padding: .8rem .6rem 2rem; }
  table { font-size: .78rem; }
  figure { overflow-x: auto; }
  figure svg { min-width: 30rem; }
}
@media print {
  @page { size: A4; margin: 15mm; }
  body { max-width: none; padding: 0; font-size: 9.5pt; }
  nav, .motion { display: none; }
  .wide { overflow: visible; }
  h2 { break-after: avoid; }
  figure, tr { break-inside: avoid; }
  figure svg { max-height: 112mm; }
}
"""

PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>$css</style>
</head>
<body>
<header>
<h1>$title</h1>
<p class="lead">$lead</p>
<p class="verdict $look">$verdict</p>
<nav>$nav</nav>
</header>
<main>
$body
</main>
</body>
</html>
""")


def write_report(
    data: dict[str, Any], scene: Scene, figures: str | Path | Iterable[str | Path], path: str | Path,
    animation: str | Path | None = None,
) -> Path:  # fmt: skip
    """Write the report of an analysis as one HTML file that needs nothing else: no network, no fonts, no other files.

    `data` is the document of the analysis (see `linkjax.analysis.document`), `figures` the files that
    `linkjax.viz.write_figures` returned (the SVG ones are put into the page, in that order) or the folder that it wrote
    them to, `animation` a GIF (from a folder, its `machine.gif` unless another is named).
    Returns the path. Raises `OSError` when a file cannot be read or written.
    """
    captions = {picture.name: picture.caption for picture in PICTURES}
    if isinstance(figures, str | Path):
        folder = Path(figures)
        moving = folder / "machine.gif"
        animation = moving if animation is None and moving.exists() else animation
        figures = [file for file in (folder / f"{name}.svg" for name in captions) if file.exists()]
    drawings = [file for file in map(Path, figures) if file.suffix == ".svg"]
    pictures = {file.stem: _figure(file, captions.get(file.stem, file.stem)) for file in drawings}
    first = pictures.pop("machine", "")
    if animation is not None:
        first += _motion(Path(animation))
    sections = {
        "Results": tables.results(data, scene),
        "Machine": first + tables.links(scene) + tables.points(scene) + tables.loads(scene),
        "Peaks": tables.peaks(data),
        "Margins": tables.groups(data) + tables.dead_centres(data),
        "Checks": tables.checks(data) + tables.model(data, scene),
        "Figures": "\n".join(pictures.values()),
    }
    sections = {name: text for name, text in sections.items() if text}
    body = [f'<section id="{name.lower()}"><h2>{name}</h2>\n{text}</section>' for name, text in sections.items()]
    outcome = data.get("result", {})
    title = scene.title or str(data.get("scene", "")) or "Machine"
    page = PAGE.substitute(
        title=escape(title),
        css=CSS,
        lead=escape(f"{scene.mechanism.formula()}, at {tables.nominal(scene)}"),
        look="good" if int(outcome.get("code", 0)) == 0 else "bad",
        verdict=escape(str(outcome.get("message", ""))),
        nav=" ".join(f'<a href="#{name.lower()}">{name}</a>' for name in sections),
        body="\n".join(body),
    )
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page, encoding="utf-8")
    return target


def _figure(file: Path, caption: str) -> str:
    return f"<figure>{inline_svg(file, caption)}<figcaption>{escape(caption)}</figcaption></figure>"


def _motion(file: Path) -> str:
    caption = "One cycle, slowed down; equal steps of time"
    image = f'<img src="{data_uri(file)}" alt="{escape(caption)}">'
    return f'<figure class="motion">{image}<figcaption>{escape(caption)}</figcaption></figure>'
