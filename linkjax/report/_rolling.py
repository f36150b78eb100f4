"""The page for rolling bodies: animated chain, tables and figures."""

from __future__ import annotations

import json
import math
from html import escape
from pathlib import Path
from typing import Any

from linkjax._units import display_units
from linkjax.report._cells import Cell, Cells, table, words
from linkjax.report._report import HERE, PAGE, figure_html
from linkjax.rolling import tidy
from linkjax.viz import ROLLING_PICTURES, scale_mark, svg

Data = dict[str, Any]
WIDE, EDGE, RIM = 560.0, 14.0, 1.075  # typographic points; outside of the drawn ring over its radius

STAGE = """<figure class="stage"><svg id="stage" viewBox="0 0 {size} {size}" role="img"
aria-label="The rolling bodies at the selected angle"></svg><noscript>{still}</noscript>
<figcaption>The rolling bodies to scale, at constant speed; dashed: ellipse of the body centres</figcaption></figure>"""

CONTROLS = """<div id="controls" role="region" aria-label="Motion of the rolling bodies"><form autocomplete="off">
<span class="turn"><label for="angle">Angle of the driven member</label>
<input type="range" id="angle" min="0" max="{end}" step="any" value="0" disabled>
<output id="angle-shown" for="angle"></output></span>
<button type="button" id="play" disabled>Play</button>
<label>Playback time <select id="pace" disabled><option value="3">3 s</option>
<option value="6" selected>6 s</option><option value="12">12 s</option><option value="24">24 s</option></select></label>
<label><input type="checkbox" id="show-names" checked disabled> Numbers</label></form></div>
<script type="application/json" id="machine-data">{view}</script>
<script>{js}</script>"""


def write_rolling_report(data: Data, path: str | Path, *, units: str = "") -> Path:
    """Write the report of a document of rolling bodies as one self-contained HTML file; returns the path.

    `units` are the display units (e.g. "in, rad/s"). Raises `OSError` if the file cannot be written, `QuantityError`
    for an unknown unit.
    """
    data, chosen = tidy(data), display_units(units)
    show = Cells(chosen)
    pictures = {
        name: figure_html(svg(name, draw(data, chosen)), name, caption)
        for name, (caption, draw) in ROLLING_PICTURES.items()
    }
    view = rolling_view(data, units)
    sections = {
        "Motion": STAGE.format(size=WIDE, still=pictures["rolling"]),
        "Bodies": _bodies(show, data),
        "Rings": _rings(show, data),
        "Speeds": _speeds(show, data),
        "Figures": "\n".join(pictures.values()),
    }
    text = json.dumps(view, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    program = CONTROLS.format(
        end=f"{math.degrees(_cycle(data)):.9g}", view=text, js=(HERE / "rolling.js").read_text(encoding="utf-8")
    )
    result, chain = data["result"], data["chain"]
    look = "bad" if result["code"] else "good"
    page = PAGE.substitute(
        title=escape(data["title"] or data["scene"] or "Rolling bodies"),
        css=(HERE / "page.css").read_text(encoding="utf-8"),
        lead=escape(f"{chain['bodies']} rolling bodies between two rings, {_drive(show, data)}"),
        verdict=f'<p class="verdict {look}">{escape(result["message"])}</p>',
        nav=" ".join(f'<a href="#{name.lower()}">{name}</a>' for name in sections),
        body="\n".join(f'<section id="{n.lower()}"><h2>{n}</h2>\n{text}</section>' for n, text in sections.items()),
        program=program,
    )
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page, encoding="utf-8")
    return target


def rolling_view(data: Data, units: str = "") -> dict[str, Any]:
    """Data to draw and animate the chain in the page, ready for `json.dumps`; lengths in m, angles in rad."""
    rings, motion = data["rings"], data["motion"]
    outer, e = rings["outer_radius"], rings["eccentricity"]
    rest = e if motion["held"] == "outer" else 0.0
    reach = RIM * outer + abs(e - rest)  # of the drawing, from the fixed point
    scale = (WIDE - 2 * EDGE) / (2 * reach)
    length, text = scale_mark(0.22 * WIDE / scale, display_units(units))
    ratios = {name: _listed(value) for name, value in motion["ratios"].items()}
    return {
        **rings, "turns": data["chain"]["turns"],
        "ratios": ratios, "rest": rest, "sense": -1 if motion["speed"] < 0 else 1, "scale": scale,
        "left": 0.5 * WIDE - scale * rest, "base": 0.5 * WIDE, "height": WIDE, "bar": {"length": length, "text": text},
        "centres": data["centres"], **{name: _listed(data["bodies"][name]) for name in ("angle", "radius", "x", "y")},
    }  # fmt: skip


def _listed(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def _cycle(data: Data) -> float:
    """Angle of the driven member at the end of the motion in the document."""
    return float(data["angles"][1] - data["angles"][0]) * len(data["angles"])


def _drive(show: Cells, data: Data) -> str:
    names = {"inner": "the inner ring", "outer": "the outer ring", "carrier": "the line of centres"}
    motion = data["motion"]
    return f"{names[motion['held']]} held, {names[motion['driven']]} driven at {show.bound(motion['speed'], 'rad/s')}"


def _bodies(show: Cells, data: Data) -> str:
    bodies, spins = data["bodies"], data["motion"]["bodies"]
    columns = [
        show.several(bodies["radius"].tolist(), "m", 9),
        [show.angle(angle) for angle in bodies["angle"]],
        show.several(bodies["x"].tolist(), "m", 6), show.several(bodies["y"].tolist(), "m", 6),
        [Cell(show.speed(spin), True) for spin in spins],
    ]  # fmt: skip
    rows = [[words(i), *cells] for i, cells in enumerate(zip(*columns, strict=True), 1)]
    head = ["body", "radius", "angle from the line of centres", "centre x", "centre y", "rotational speed"]
    return table(head, rows)


def _rings(show: Cells, data: Data) -> str:
    rings, limits, chain = data["rings"], data["limits"], data["chain"]
    rows = [
        [words(name), show.amount(value, unit, 9)]
        for name, value, unit in (
            ("radius of the inner ring", rings["inner_radius"], "m"),
            ("radius of the outer ring", rings["outer_radius"], "m"),
            ("eccentricity", rings["eccentricity"], "m"),
            ("outer radius that closes the chain", limits["closing_outer_radius"], "m"),
            ("eccentricity that closes the chain with these rings", limits["closing_eccentricity"], "m"),
            ("max body radius that fits", limits["max_radius"], "m"),
            ("min body radius that fits", limits["min_radius"], "m"),
            ("semi-major axis of the ellipse of the body centres", data["centres"]["semi_major"], "m"),
            ("semi-minor axis of the ellipse of the body centres", data["centres"]["semi_minor"], "m"),
            ("min clearance between non-adjacent bodies", limits["min_clearance"], "m"),
            ("number of bodies that closes the chain", limits["fitting_bodies"], ""),
            ("ring margin, (R − r − e) / R", limits["ring_margin"], ""),
            ("closing margin, (closing eccentricity / R)²", limits["closing_margin"], ""),
        )
    ]
    rows.append([words("clearance between last and first body"), show.amount(chain["closing_clearance"], "m", 2)])
    rows.append([words("max gap or overlap at contacts, over R"), show.amount(data["checks"]["contacts"], "", 2)])
    return table(["quantity", "value"], [[name, Cell(cell.text, True)] for name, cell in rows])


def _speeds(show: Cells, data: Data) -> str:
    motion = data["motion"]
    rows = [
        [words(name), Cell(show.speed(motion[key]), True), show.amount(motion["ratios"][key], "", 6)]
        for key, name in (("inner", "inner ring"), ("outer", "outer ring"), ("carrier", "line of centres"))
    ]
    rows.append([words("sliding speed between neighbours"), show.amount(motion["rubbing"], "m/s", 6), Cell("", True)])
    return table(["member", "rotational speed", "ratio to the driven member"], rows)
