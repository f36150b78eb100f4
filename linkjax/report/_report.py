"""The page: animated machine, tables and figures."""

from __future__ import annotations

import json
from collections.abc import Iterable
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from linkjax._display import retold
from linkjax._units import display_units
from linkjax.machine import Scene
from linkjax.report import _optimum, _tables
from linkjax.report._cells import Cells
from linkjax.report._embed import inline_svg
from linkjax.report._energies import energies
from linkjax.report._harmonics import harmonics_table
from linkjax.viz import PICTURES, courses, drawn, machine_view, svg

Data = dict[str, Any]
HERE = Path(__file__).parent

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
$verdict
<nav aria-label="Contents">$nav</nav>
</header>
<main>
$body
</main>
$program
</body>
</html>
""")

STAGE = Template("""<figure class="stage">
<svg id="stage" viewBox="0 0 $width $height" role="img" aria-label="The machine at the selected crank angle"></svg>
<ul class="legend">$legend</ul>
<noscript>$still</noscript>
<figcaption>The machine to scale$figcaption</figcaption>
</figure>""")

CONTROLS = Template("""<div id="controls" role="region" aria-label="Motion of the machine"><form autocomplete="off">
<span class="turn"><label for="angle">Crank angle φ</label>
<input type="range" id="angle" min="0" max="$end" step="any" value="$start" disabled>
<output id="angle-shown" for="angle"></output></span>
<button type="button" id="play" disabled>Play</button>
<label>Playback time <select id="pace" disabled><option value="1">1 s</option><option value="2">2 s</option>
<option value="4" selected>4 s</option><option value="8">8 s</option><option value="16">16 s</option></select></label>
<label><input type="checkbox" id="show-names" checked disabled> Names</label>
$before</form></div>
<script type="application/json" id="machine-data">$view</script>
<script>$js</script>""")

PLAYED = 4.0  # s of a cycle on the page, as selected in the controls
HINT = '<p class="lead screen">Click or drag in a diagram over the crank angle to set the angle of the machine.</p>\n'
BEFORE = '<label><input type="checkbox" id="show-before" checked disabled> Before</label>'


def write_report(
    data: Data, scene: Scene, path: str | Path, *, figures: str | Path | Iterable[str | Path] | None = None,
    before: tuple[Data, Scene] | None = None, optimum: Data | None = None, units: str = "",
) -> Path:  # fmt: skip
    """Write the report of an analysis as one self-contained HTML file: no network, no fonts, no other files.

    `data` is the document of the analysis (see `linkjax.analysis.document`); `before` the document and scene of an
    earlier design, shown for comparison; `optimum` the document of the optimisation from the earlier design to this
    one; `units` the display units (e.g. "mm, rpm, kN"; default SI with prefixes). `figures` are the files returned by
    `linkjax.viz.write_figures`, whose SVG files are embedded in that order, or the folder with these files; by default
    the figures are drawn.
    Returns the path. Raises `OSError` if a file cannot be read or written, `QuantityError` for an unknown unit,
    `ValueError` if the two designs are analysed at different crank angles.
    """
    if before is not None and not np.array_equal(data["angles"], before[0]["angles"]):
        counts = f"{np.size(before[0]['angles'])} and {np.size(data['angles'])}"
        raise ValueError(f"before and after have different crank angles ({counts}); analyse both with equal `angles`")
    chosen = display_units(units)
    show = Cells(chosen)
    captions = {picture.name: picture.caption for picture in PICTURES}
    if figures is None:
        old = before[0] if before else None
        drawings = {name: svg(name, figure) for name, figure in drawn(data, scene, old, chosen)}
    else:
        drawings = _read(figures, list(captions))
    pictures = {name: figure_html(text, name, captions.get(name, name)) for name, text in drawings.items()}
    still = pictures.pop("machine", "")
    view = machine_view(data, scene, before, chosen) if data.get("points") else None
    sections = {
        "Motion": _stage(view, data, still) if view else still,
        "Optimisation": _optimisation(show, optimum) if optimum else "",
        "Results": _tables.results(show, data, scene, before[0] if before else None)
        + _tables.motor_load(show, data, before[0] if before else None)
        + energies(show, data, before[0] if before else None),
        "Machine": _tables.links(show, scene) + _tables.points(show, scene) + _tables.motor(show, scene)
        + _tables.friction(show, scene) + _tables.loads(show, data, scene),
        "Peaks": _tables.peaks(show, data, before[0] if before else None) + _tables.measures(show, data)
        + harmonics_table(show, data),
        "Margins": _tables.groups(show, data) + _tables.dead_centres(show, data),
        "Checks": _tables.checks(show, data) + _tables.model(data, scene),
        "Figures": (HINT if view and pictures else "") + "\n".join(pictures.values()),
    }  # fmt: skip
    sections = {name: text for name, text in sections.items() if text}
    title = scene.title or str(data.get("scene", "")) or "Machine"
    page = PAGE.substitute(
        title=escape(title),
        css=(HERE / "page.css").read_text(encoding="utf-8"),
        lead=escape(f"{scene.mechanism.formula()}, at {_tables.nominal(show, scene)}"),
        verdict="\n".join(_verdicts(show, optimum, data, before)),
        nav=" ".join(f'<a href="#{name.lower()}">{name}</a>' for name in sections),
        body="\n".join(f'<section id="{n.lower()}"><h2>{n}</h2>\n{text}</section>' for n, text in sections.items()),
        program=_program(view) if view else "",
    )
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page, encoding="utf-8")
    return target


def _read(figures: str | Path | Iterable[str | Path], names: list[str]) -> dict[str, str]:
    """Contents of SVG files by name, from a list of files or from a folder."""
    if isinstance(figures, str | Path):
        files = [file for name in names if (file := Path(figures) / f"{name}.svg").exists()]
    else:
        files = [file for file in map(Path, figures) if file.suffix == ".svg"]
    return {file.stem: file.read_text(encoding="utf-8") for file in files}


def figure_html(text: str, name: str, caption: str) -> str:
    """A figure with its caption, from its SVG text."""
    return f"<figure>{inline_svg(text, name, caption)}<figcaption>{escape(caption)}</figcaption></figure>"


def _verdict(show: Cells, result: Data) -> str:
    look = "good" if int(result.get("code", 0)) == 0 else "bad"
    message = retold(str(result.get("message", "")), show)
    return f'<p class="verdict {look}">{escape(message[:1].upper() + message[1:])}</p>'


def _verdicts(show: Cells, optimum: Data | None, data: Data, before: tuple[Data, Scene] | None) -> list[str]:
    """Results of the optimisation and of the analysis, and a failure of the earlier design, if any."""
    found = [of.get("result") or {} for of in (optimum, data) if of]
    old = before[0].get("result") or {} if before else {}
    if old.get("code"):
        found.append({**old, "message": f"Before: {old['message']}"})
    return [_verdict(show, result) for result in found]


def _optimisation(show: Cells, optimum: Data) -> str:
    """Problem, results and convergence of the optimisation."""
    tables = (_optimum.asked(show, optimum), _optimum.conflicts(optimum), _optimum.measures(show, optimum),
              _optimum.variables(show, optimum), _optimum.limits(show, optimum))  # fmt: skip
    figures = [figure_html(svg(of.name, figure), of.name, of.caption) for of, figure in courses(optimum, show.units)]
    return "".join((*tables, *figures)) + _optimum.outcome(show, optimum)


def _stage(view: Data, data: Data, still: str) -> str:
    """The element for the animated machine, with the static drawing for browsers without scripts."""
    shapes = [(link["name"], link["colour"], link["fill"], "") for link in view["machines"][0]["links"]]
    shapes += [("before", "#a8a8a8", "#f3f3f3", ' class="before"')] if len(view["machines"]) > 1 else []
    legend = "".join(
        f'<li{look}><i style="border-color:{edge};background:{fill}"></i>{escape(name)}</li>'
        for name, edge, fill, look in shapes
    )
    timed = ""
    if view["time"] and "motion" in data:
        timed = "; animated in the actual motion, "
        timed += "faster than the machine" if view["time"][-1] > PLAYED else "slowed down"
    return STAGE.substitute(width=view["width"], height=view["height"], legend=legend, still=still,
                            figcaption=f'<span class="screen">{timed}</span>')  # fmt: skip


def _program(view: Data) -> str:
    return CONTROLS.substitute(
        end=360 * view["cycle_turns"],
        start=f"{view['start']:g}",
        before=BEFORE if len(view["machines"]) > 1 else "",
        view=json.dumps(view, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c"),
        js=(HERE / "page.js").read_text(encoding="utf-8"),
    )
