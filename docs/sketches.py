"""Sketches of the groups of scene files: their pins, links and keys. `docs/pictures.py` writes them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon

from linkjax.viz import svg

BAR, OTHER, KNOWN, SIZE, PATH = "#1f4e79", "#b5b5b5", "#1f4e79", "#b03a2e", "#777777"
WORD = {"size": 9, "family": "monospace", "color": "#222222", "ha": "center", "va": "center"}
PAPER = {"facecolor": "white", "linewidth": 0, "pad": 1.0}


def at(angle: float, size: float = 1.0) -> np.ndarray:
    """A vector at an angle (degrees)."""
    return size * np.asarray([math.cos(math.radians(angle)), math.sin(math.radians(angle))])


class Sketch:
    """One drawing; places are pairs of numbers, angles in degrees."""

    def __init__(self, width: float, height: float):
        self.figure = Figure(figsize=(0.62 * width, 0.62 * height))
        self.ax: Axes = self.figure.add_axes((0, 0, 1, 1))
        self.ax.set_xlim(0, width)
        self.ax.set_ylim(0, height)
        self.ax.set_axis_off()

    def word(self, place, text: str, colour: str = "#222222", by=(0.0, 0.0)) -> None:
        self.ax.text(*np.add(place, by), text, **{**WORD, "color": colour}, bbox=PAPER, zorder=8)

    def bar(self, a, b, other: bool = False) -> None:
        """A link, or where it would be with the other `side`."""
        look = {"color": OTHER, "linewidth": 1.4, "linestyle": (0, (4, 3)), "zorder": 2}
        look = look if other else {"color": BAR, "linewidth": 3.2, "zorder": 3, "solid_capstyle": "round"}
        self.ax.plot(*zip(a, b, strict=True), **look)

    def pin(self, place, known: bool = False, other: bool = False) -> None:
        """A pin: filled where the point exists before the group."""
        colour = OTHER if other else BAR
        self.ax.add_patch(
            Circle(tuple(place), 0.13, facecolor=KNOWN if known else "white", edgecolor=colour, linewidth=1.5, zorder=6)
        )

    def ground(self, place) -> None:
        """The frame below a pin."""
        x, y = place
        self.ax.add_patch(
            Polygon([(x, y), (x - 0.3, y - 0.45), (x + 0.3, y - 0.45)], facecolor="#eeeeee", edgecolor=PATH, zorder=2)
        )
        for i in range(5):
            self.ax.plot(*zip((x - 0.3 + 0.13 * i, y - 0.45), (x - 0.4 + 0.13 * i, y - 0.6), strict=True), color=PATH)

    def path(self, a, b, arrow: bool = True) -> None:
        """A guide, with its direction."""
        self.ax.plot(*zip(a, b, strict=True), color=PATH, linewidth=1.1, linestyle=(0, (9, 2, 2, 2)), zorder=1)
        if arrow:
            d = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
            self.arrow(np.subtract(b, 0.01 * d), np.asarray(b), PATH)

    def block(self, place, angle: float, other: bool = False, length: float = 0.8, width: float = 0.46) -> None:
        """A slider."""
        u, v = at(angle, length / 2), at(angle + 90, width / 2)
        corners = [np.add(place, s * u + t * v) for s, t in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        look = {"facecolor": "white", "edgecolor": OTHER, "linestyle": (0, (4, 3)), "zorder": 2}
        look = look if other else {"facecolor": "#dce6f1", "edgecolor": BAR, "linewidth": 1.6, "zorder": 4}
        self.ax.add_patch(Polygon(corners, **look))

    def arrow(self, a, b, colour: str = SIZE, both: bool = False) -> None:
        style = "<|-|>" if both else "-|>"
        look = {"arrowstyle": style, "color": colour, "linewidth": 1.0, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9}
        self.ax.annotate("", tuple(b), tuple(a), arrowprops=look, zorder=7)

    def size(self, a, b, text: str, beside=(0.0, 0.0)) -> None:
        """A dimension between two places."""
        self.arrow(a, b, both=True)
        self.word(np.add(np.add(a, b) / 2, beside), text, SIZE)

    def angle(self, place, radius: float, start: float, stop: float, text: str, far: float = 0.55) -> None:
        """An angle about a place, from a thin line at `start`."""
        self.ax.plot(*zip(place, np.add(place, at(start, radius + 0.3)), strict=True), color=SIZE, linewidth=0.7)
        self.ax.add_patch(Arc(tuple(place), 2 * radius, 2 * radius, theta1=start, theta2=stop, color=SIZE, zorder=5))
        end, way = np.add(place, at(stop, radius)), at(stop + 90, 0.02)
        self.arrow(end - way, end + way)
        self.word(np.add(place, at((start + stop) / 2, radius + far)), text, SIZE)

    def circle(self, place, radius: float, look: str = BAR) -> None:
        self.ax.add_patch(Circle(tuple(place), radius, fill=False, edgecolor=look, linewidth=1.8, zorder=3))


def crank() -> Sketch:
    made = Sketch(7, 4)
    a, b = np.asarray([1.6, 1.2]), np.asarray([1.6, 1.2]) + at(38, 3.2)
    made.ground(a)
    made.bar(a, b)
    made.pin(a, known=True)
    made.pin(b)
    made.angle(a, 1.5, 0, 38, "phase + φ", 0.75)
    made.word(a, "pivot", by=(-0.75, 0.1))
    made.word(b, "end", by=(0.55, 0.1))
    made.word((a + b) / 2 + at(128, 0.45), "link")
    return made


def link() -> Sketch:
    made = Sketch(10, 5.6)
    a, turn = np.asarray([1.4, 1.2]), 18
    c = a + at(turn, 4.6) + at(turn + 90, 1.7)
    made.path(a + at(turn, -0.8), a + at(turn, 8.4))
    made.bar(a, a + at(turn, 7.2))
    made.pin(a)
    made.pin(a + at(turn, 7.2))
    made.size(a + at(turn - 90, 0.95), a + at(turn, 7.2) + at(turn - 90, 0.95), "length")
    made.size(a + at(turn - 90, 0.4), a + at(turn, 4.6) + at(turn - 90, 0.4), "along", (0.5, 0.16))
    made.size(a + at(turn, 4.6), c, "across", (0.65, 0.1))
    made.ax.plot(*zip(a, c, strict=True), color=SIZE, linewidth=0.7)
    made.word(a + (c - a) * 0.55, "at", SIZE, by=(-0.25, 0.3))
    made.angle(a, 2.2, turn, turn + 20.3, "turned", 0.75)
    made.ax.plot(*c, "o", color="#222222", markersize=5, zorder=7)
    made.word(c, "centre, points.E", by=(0.3, 0.45))
    made.word(a, "first pin", by=(-0.75, -0.4))
    made.word(a + at(turn, 7.2), "far pin", by=(0.55, -0.35))
    made.word(a + at(turn, 8.0), "axis of the link", PATH, by=(-0.6, 0.6))
    return made


def rod_and_slider() -> Sketch:
    made = Sketch(11, 4.6)
    b, foot, ahead = np.asarray([4.6, 3.7]), np.asarray([4.6, 1.2]), 4.0
    d, other = foot + at(0, ahead), foot - at(0, ahead - 0.4)
    made.path((0.6, 1.2), (10.6, 1.2))
    made.ax.plot(*zip(b, foot, strict=True), color=OTHER, linewidth=0.9, linestyle=":")
    for end, grey in ((d, False), (other, True)):
        made.block(end, 0, grey)
        made.bar(b, end, grey)
        made.pin(end, other=grey)
    made.pin(b, known=True)
    made.word(b, "from", by=(0.7, 0.15))
    made.word(d, "end", by=(0, 0.62))
    made.word(d, "block", by=(0, -0.6))
    made.word((b + d) / 2, "link", by=(0.5, 0.35))
    made.word((8.2, 0.3), 'side = "+": ahead of the foot')
    made.word((2.0, 0.3), 'side = "-"', PATH)
    made.word((10.35, 1.6), "guide", PATH)
    return made


def guide() -> Sketch:
    made = Sketch(9, 5.6)
    a, turn, shift = np.asarray([1.8, 1.0]), 24, 1.2
    made.ground(a)
    made.path(a + at(turn, -0.9), a + at(turn, 6.6), arrow=False)
    made.path(a + at(turn, -0.9) + at(turn + 90, shift), a + at(turn, 6.4) + at(turn + 90, shift))
    made.pin(a, known=True)
    made.size(a + at(turn, 3), a + at(turn, 3) + at(turn + 90, shift), "offset", (0.75, -0.1))
    made.angle(a, 1.9, 0, turn, "along", 0.65)
    made.block(a + at(turn, 4.9) + at(turn + 90, shift), turn)
    made.pin(a + at(turn, 4.9) + at(turn + 90, shift))
    made.word(a, "through", by=(-1.0, -0.1))
    made.word(a + at(turn, 3.0) + at(turn + 90, shift + 0.9), "path of the pin", PATH)
    return made


def two_links() -> Sketch:
    made = Sketch(9, 6.6)
    a, b = np.asarray([1.4, 3.3]), np.asarray([7.4, 3.0])
    c, other = np.asarray([4.9, 5.6]), np.asarray([4.67, 0.83])
    for end, grey in ((other, True), (c, False)):
        made.bar(a, end, grey)
        made.bar(end, b, grey)
        made.pin(end, other=grey)
    made.path(a, b)
    made.pin(a, known=True)
    made.pin(b, known=True)
    made.word(a, "from", by=(-0.8, 0))
    made.word(b, "to", by=(0.6, 0))
    made.word(c, "meet", by=(0, 0.5))
    made.word((a + c) / 2, "links[0]", by=(-0.75, 0.3))
    made.word((b + c) / 2, "links[1]", by=(0.85, 0.3))
    made.word((4.7, 3.75), 'side = "left" of the line')
    made.word((4.7, 2.55), 'side = "right"', PATH)
    return made


def lever_and_slider() -> Sketch:
    made = Sketch(10, 4.8)
    p, turn, shift = np.asarray([2.9, 1.2]), 20, 0.95
    pin = p + at(turn, 3.6) + at(turn + 90, shift)
    behind = p + at(turn, -1.9) + at(turn + 90, shift)
    made.ground(p)
    made.bar(p, p + at(turn, 6.2))
    made.path(p + at(turn, -2.4) + at(turn + 90, shift), p + at(turn, 6) + at(turn + 90, shift))
    made.block(pin, turn)
    made.block(behind, turn, other=True)
    made.pin(behind, other=True)
    made.pin(pin, known=True)
    made.pin(p, known=True)
    made.pin(p + at(turn, 6.2))
    made.size(p + at(turn, 2.2), p + at(turn, 2.2) + at(turn + 90, shift), "offset", (-0.75, 0.2))
    made.word(p, "about", by=(0.85, -0.35))
    made.word(pin + at(turn + 90, 0.62), "from")
    made.word(pin + at(turn, 0.95) + at(turn + 90, 0.35), "block")
    made.word(p + at(turn, 6.2), "end", by=(0.3, -0.5))
    made.word(p + at(turn, 4.4) + at(turn - 90, 0.5), "link")
    made.word((2.6, 4.2), 'side = "+": ahead of about')
    made.word(behind, 'side = "-"', PATH, by=(0.1, -0.75))
    return made


def yoke_and_block() -> Sketch:
    made = Sketch(9, 5.4)
    e, slot, shift = np.asarray([3.4, 1.1]), 66, 1.3
    away = e + at(slot + 90, shift)
    made.path((0.6, 1.1), (8.6, 1.1))
    made.block(e, 0, length=1.6)
    made.path(away + at(slot, -0.2), away + at(slot, 3.9))
    for sense in (-0.3, 0.3):
        made.bar(away + at(slot, 0.6) + at(slot + 90, sense), away + at(slot, 3.6) + at(slot + 90, sense))
    made.bar(e, e + at(slot, 0.9) + at(slot + 90, shift - 0.3))
    b = away + at(slot, 2.2)
    made.block(b, slot)
    made.pin(b, known=True)
    made.pin(e)
    made.angle(e, 1.6, 0, slot, "slot", 0.45)
    made.ax.plot(*zip(e, e + at(slot, 3.4), strict=True), color=SIZE, linewidth=0.7)
    made.size(e + at(slot, 3.1), e + at(slot, 3.1) + at(slot + 90, shift), "offset", (0.75, 0.42))
    made.word(e, "end", by=(0.1, -0.6))
    made.word(b, "from", by=(0.85, -0.05))
    made.word(b, "block", by=(-0.95, 0.1))
    made.word(away + at(slot, 0.9), "link", by=(-0.95, 0.0))
    made.word((7.9, 1.45), "guide", PATH)
    return made


def two_sliders() -> Sketch:
    made = Sketch(9, 5)
    m, one, two = np.asarray([4.4, 2.4]), 12, 78
    made.path(m + at(one, -3.6), m + at(one, 3.8))
    made.path(m + at(two, -2.2), m + at(two, 2.4))
    made.block(m, one, length=1.5, width=0.9)
    made.block(m, two, length=0.8, width=0.4)
    made.pin(m)
    made.word(m, "meet", by=(0.95, -0.6))
    made.word(m, "blocks[0]", by=(-1.35, 0.35))
    made.word(m + at(two, 1.0), "blocks[1]", by=(1.0, 0.0))
    made.word(m + at(one, 3.3), "slots[0]", PATH, by=(0.3, -0.55))
    made.word(m + at(two, 2.2), "slots[1]", PATH, by=(-0.95, 0.0))
    made.word((7.1, 4.5), 'side = "left": slots[1]\npoints left of slots[0]')
    return made


def gears() -> Sketch:
    made = Sketch(10, 5)
    a, d, r, s = np.asarray([2.4, 2.6]), np.asarray([6.6, 2.6]), 1.9, 2.3
    for place, radius in ((a, r), (d, s)):
        made.circle(place, radius)
        made.ground(place)
        made.pin(place, known=True)
    pin = d + at(50, 1.5)
    made.bar(d, pin)
    made.pin(pin)
    made.angle(d, 0.95, 0, 50, "phase", 0.75)
    made.word(a, "centre", by=(-0.1, 0.45))
    made.word(d, "pivot", by=(-0.75, 0.3))
    made.word(pin, "end", by=(0.3, 0.4))
    made.word(a + at(125, r + 0.4), "to")
    made.word(d + at(125, s + 0.35), "link")
    made.word(a, "teeth[1]", by=(0, -1.2))
    made.word(d, "teeth[0]", by=(0, -1.3))
    return made


def belt() -> Sketch:
    made = Sketch(10, 4.6)
    a, d, r, s = np.asarray([2.2, 2.3]), np.asarray([7.2, 2.3]), 1.6, 0.9
    lean = math.degrees(math.asin((r - s) / 5.0))
    for way in (1, -1):
        turn = way * (90 - lean)
        made.ax.plot(*zip(a + at(turn, r), d + at(turn, s), strict=True), color="#333333", linewidth=1.6)
    for place, radius in ((a, r), (d, s)):
        made.circle(place, radius)
        made.pin(place, known=True)
    made.size(a, a + at(200, r), "radii[1]", (0.05, -0.35))
    made.size(d, d + at(-30, s), "radii[0]", (0.95, -0.35))
    made.word(a, "centre", by=(0.1, 0.45))
    made.word(d, "pivot", by=(0, 0.42))
    made.word(d, "link", by=(1.5, 0.4))
    made.word(a, "to", by=(-1.9, 0.6))
    made.word((5.0, 0.55), "tension of the slack strand", PATH)
    return made


def rack() -> Sketch:
    made = Sketch(10.5, 5)
    d, r, x = np.asarray([4.4, 2.9]), 1.5, 1.4
    foot = np.asarray([2.0, x])
    made.circle(d, r)
    made.path((0.6, x), (10.0, x))
    for i in range(36):
        made.ax.plot([1.4 + 0.2 * i, 1.5 + 0.2 * i, 1.6 + 0.2 * i], [x, x - 0.13, x], color=BAR, linewidth=0.9)
    made.ax.plot([1.4, 8.6], [x - 0.3, x - 0.3], color=BAR, linewidth=2.4)
    e = np.asarray([7.4, x])
    made.pin(d, known=True)
    made.pin(foot, known=True)
    made.pin(e)
    made.size(d, d + at(140, r), "radius", (-0.25, 0.65))
    made.size(foot + at(-90, 0.75), e + at(-90, 0.75), "start, at gear angle zero")
    made.word(d, "centre", by=(0.85, 0.1))
    made.word(d + at(40, r + 0.35), "to")
    made.word(foot, "through", by=(-0.3, 0.5))
    made.word(e, "end", by=(0, 0.45))
    made.word((8.9, 0.95), "link")
    made.word((8.4, 3.9), 'side = "left": the gear\nis left of the guide')
    made.word((9.6, 1.8), "guide", PATH)
    return made


def driving_slider() -> Sketch:
    made = Sketch(9, 5)
    a, turn, shift = np.asarray([1.8, 1.0]), 20, 1.0
    foot = a + at(turn + 90, shift)
    b = foot + at(turn, 4.4)
    made.ground(a)
    made.ax.plot(*zip(a, foot, strict=True), color=OTHER, linewidth=0.9, linestyle=":")
    made.path(foot + at(turn, -0.9), foot + at(turn, 6.6))
    made.block(b, turn)
    made.pin(a, known=True)
    made.pin(b)
    made.size(foot + at(turn + 90, 0.7), b + at(turn + 90, 0.7), "law: the distance", (-0.3, 0.35))
    made.word(a, "through", by=(-1.0, -0.1))
    made.word(b, "end", by=(0.1, -0.5))
    made.word(b + at(turn, 0.75), "link", by=(0.15, -0.35))
    made.word(foot + at(turn, 6.2), "guide", PATH, by=(-0.1, 0.45))
    return made


def pinion() -> Sketch:
    made = Sketch(10.5, 5)
    d, r, x = np.asarray([4.4, 2.9]), 1.5, 1.4
    made.circle(d, r)
    made.path((0.6, x), (10.0, x))
    for i in range(30):
        made.ax.plot([2.6 + 0.2 * i, 2.7 + 0.2 * i, 2.8 + 0.2 * i], [x, x - 0.13, x], color=BAR, linewidth=0.9)
    made.ax.plot([2.6, 8.6], [x - 0.3, x - 0.3], color=BAR, linewidth=2.4)
    c, far = np.asarray([7.4, x]), d + at(55, 1.15)
    made.bar(d, far)
    made.pin(far)
    made.pin(d, known=True)
    made.pin(c, known=True)
    made.angle(d, 0.75, 0, 55, "phase", 1.35)
    made.ax.plot([d[0], d[0]], [d[1], 0.65], color=OTHER, linewidth=0.9, linestyle=":")
    made.size((d[0], x - 0.75), c + at(-90, 0.75), "start", (0.0, 0.0))
    made.size(d, d + at(165, r), "radius", (-0.1, -0.35))
    made.word(d, "pivot", by=(-0.1, -0.45))
    made.word(far, "end", by=(-0.45, 0.1))
    made.word(d + at(130, r + 0.35), "link")
    made.word(c, "at", by=(0, 0.42))
    made.word((8.9, 0.95), "to")
    made.word((8.4, 3.9), 'side = "left": the gear\nis left of the guide')
    return made


def redundant() -> Sketch:
    made = Sketch(12, 4.6)
    up, left, right, middle = at(55, 2.3), np.asarray([1.2, 1.2]), np.asarray([5.4, 1.2]), np.asarray([3.3, 1.2])
    for foot in (left, right):
        made.ground(foot)
        made.bar(foot, foot + up, other=True)
        made.pin(foot, other=True)
        made.pin(foot + up, other=True)
    made.ground(middle)
    made.bar(left + up, right + up, other=True)
    made.bar(middle, middle + up)
    made.pin(middle, known=True)
    made.pin(middle + up, known=True)
    made.word(middle, "from", by=(-0.75, 0.15))
    made.word(middle + up, "to", by=(0, 0.45))
    made.word(middle + 0.5 * up, "link", by=(0.6, -0.1))
    e = np.asarray([9.2, 2.3])
    made.path((7.4, 2.3), (11.6, 2.3))
    made.block(e, 0)
    made.pin(e, known=True)
    made.word(e, "from", by=(0, 0.62))
    made.word(e, "block", by=(0, -0.6))
    made.word((11.2, 2.7), "guide", PATH)
    return made


SKETCHES: dict[str, Callable[[], Sketch]] = {
    "crank": crank, "link": link, "RRP": rod_and_slider, "guide": guide, "RRR": two_links, "RPR": lever_and_slider,
    "RPP": yoke_and_block, "PRP": two_sliders, "gear": gears, "belt": belt, "rack": rack,
    "linear_driver": driving_slider, "pinion": pinion, "redundant": redundant,
}  # fmt: skip


def sketches() -> dict[str, str]:
    """Every sketch as SVG text, by its name."""
    return {f"groups/{name}": svg(f"group-{name}", draw().figure) for name, draw in SKETCHES.items()}
