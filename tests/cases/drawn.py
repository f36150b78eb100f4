"""Scene files by an independent method: the drawing is read from the text of a file, its joints are closed in NumPy.

Nothing of linkjax is used. Every link has a position and an angle; pins, slots and gears are equations between them,
which Newton's method closes from one crank angle to the next. A range ends at a fold, where the Jacobian is singular.
"""

from __future__ import annotations

import cmath
import math
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import root

UNITS = {"": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048, "deg": math.pi / 180}
STEP = math.radians(1.0)
NEAR = 1e-4  # rad: distance to a fold at which its position is refined


def quantity(text: Any) -> float:
    """A length or an angle, in SI units."""
    number, _, unit = text.partition(" ") if isinstance(text, str) else (text, "", "")
    return float(number) * UNITS[unit]


def place(pair: Any) -> complex:
    return complex(quantity(pair[0]), quantity(pair[1]))


class Bar(NamedTuple):
    """A link: its points in its own axes, and the angle of these axes as drawn."""

    points: dict[str, complex]
    drawn: float


class Figure:
    """The content of a scene file."""

    def __init__(self, path: Path):
        self.table = table = tomllib.loads(path.read_text(encoding="utf-8"))
        self.fixed = {name: place(at) for name, at in table["fixed"].items()}
        self.spots = self.fixed | {name: place(at) for name, at in table.get("sketch", {}).items()}
        self.slots = {slot["block"]: slot["guide"] for slot in table.get("slots", [])}
        self._crank(table["drive"])
        self.bars: dict[str, Bar] = {}
        for name in table["links"]:
            self._bar(name)
        self.names = list(self.bars)
        drive = table["drive"]
        self.link, self.on = drive["link"], drive.get("on", "frame")
        self.slides = "stroke" in drive
        self.law = drive.get("stroke", drive.get("law"))
        self.turns = -1 if table.get("rotation") == "cw" else 1
        sign = {False: -1.0, True: 1.0}
        self.ratios = [
            (gear["link"], gear["to"], sign[gear.get("internal", False)] * gear["teeth"][1] / gear["teeth"][0])
            for gear in table.get("gears", [])
        ]
        self.racks = [
            (rack["link"], rack["to"], quantity(rack["radius"]) * (-1 if rack.get("side") == "right" else 1))
            for rack in table.get("racks", [])
        ]

    @property
    def size(self) -> float:
        """The largest distance between two points (m)."""
        every = np.array(list(self.spots.values()))
        return float(np.abs(every[:, None] - every).max())

    def _crank(self, drive: dict[str, Any]) -> None:
        """The pins of a crank if its length and phase are given instead."""
        link = self.table["links"][drive["link"]]
        if "phase" in drive and "length" in link:
            one, two = link["pins"][:2]
            self.spots.setdefault(two, self.spots[one] + cmath.rect(quantity(link["length"]), quantity(drive["phase"])))

    def _bar(self, name: str) -> Bar:
        if name in self.bars:
            return self.bars[name]
        link = self.table["links"][name]
        pins, spots = link["pins"], self.spots
        if name in self.slots:
            guide = self.slots[name]
            on = guide.get("on", "frame")
            angle = quantity(guide.get("along", 0)) + (0.0 if on == "frame" else self._bar(on).drawn)
        else:
            angle = cmath.phase(spots[pins[1]] - spots[pins[0]])
        points = {pins[0]: 0j} | {
            pin: (spots[pin] - spots[pins[0]]) * cmath.exp(-1j * angle) for pin in pins[1:] if pin in spots
        }
        if "length" in link:
            points[pins[1]] = complex(quantity(link["length"]))
        for point, at in link.get("points", {}).items():
            along, across = (at["along"], at.get("across", 0)) if isinstance(at, dict) else (at, 0)
            points[point] = complex(quantity(along), quantity(across))
        if "sides" in link:  # of a triangle
            side = {frozenset(key.split("-")): quantity(value) for key, value in link["sides"].items()}
            one, two, three = pins
            base, a, b = (side[frozenset(ends)] for ends in ((one, two), (one, three), (two, three)))
            foot = (base**2 + a**2 - b**2) / (2 * base)
            left = ((spots[two] - spots[one]).conjugate() * (spots[three] - spots[one])).imag > 0
            points = {
                one: 0j,
                two: complex(base),
                three: complex(foot, math.sqrt(a**2 - foot**2) * (1 if left else -1)),
            }
        self.bars[name] = Bar(points, angle)
        return self.bars[name]

    # ---- equations

    def start(self) -> np.ndarray:
        """All positions and angles as drawn."""
        x = []
        for name, bar in self.bars.items():
            pin = self.table["links"][name]["pins"][0]
            x += [self.spots[pin].real, self.spots[pin].imag, bar.drawn]
        return np.array(x)

    def _angle(self, x, name: str):
        return 0.0 * x[0] if name == "frame" else x[3 * self.names.index(name) + 2]

    def _point(self, x, name: str, point: str):
        if name == "frame":
            return self.fixed[point].real + 0.0 * x[0], self.fixed[point].imag + 0.0 * x[0]
        i, at = 3 * self.names.index(name), self.bars[name].points[point]
        c, s = np.cos(x[i + 2]), np.sin(x[i + 2])
        return x[i] + at.real * c - at.imag * s, x[i + 1] + at.real * s + at.imag * c

    def way(self, x, block: str):
        """The position of a block along and beside its guide."""
        guide = self.slots[block]
        on, pin = guide.get("on", "frame"), self.table["links"][block]["pins"][0]
        (px, py), (qx, qy) = self._point(x, block, pin), self._point(x, on, guide["through"])
        turn = self._angle(x, on) + quantity(guide.get("along", 0))
        c, s, dx, dy = np.cos(turn), np.sin(turn), px - qx, py - qy
        return dx * c + dy * s, dy * c - dx * s - quantity(guide.get("offset", 0))

    def moved(self, x):
        """The coordinate that the drive prescribes."""
        return self.way(x, self.link)[0] if self.slides else self._angle(x, self.link) - self._angle(x, self.on)

    def told(self, phi: float, first: float) -> float:
        """The value that the drive prescribes for this coordinate at a crank angle; at the start it is `first`."""
        if self.law is None:
            return first + self.turns * phi
        start, stop = quantity(self.law["start"]) if "start" in self.law else first, quantity(self.law["stop"])
        return start + (stop - start) * (1 - math.cos(phi)) / 2

    def open(self, x, phi: float, begun: np.ndarray):
        """Closure errors of all joints and of the drive; `begun` is the drawn configuration."""
        first = np.real(np.ravel(self.moved(begun))[0])
        left, holders = [self.moved(x) - self.told(phi, first)], {}
        for name in self.names:
            for pin in self.table["links"][name]["pins"]:
                holders.setdefault(pin, ["frame"] if pin in self.fixed else []).append(name)
        for pin, every in holders.items():
            px, py = self._point(x, every[0], pin)
            for other in every[1:]:
                qx, qy = self._point(x, other, pin)
                left += [qx - px, qy - py]
        for block, guide in self.slots.items():
            turn = self._angle(x, guide.get("on", "frame")) + quantity(guide.get("along", 0))
            left += [self.way(x, block)[1], self._angle(x, block) - turn]
        for wheel, to, ratio in self.ratios:
            carrier = self._carrier(wheel)
            turned = [self._angle(x, name) - self._angle(begun, name) for name in (wheel, to, carrier)]
            left.append(turned[0] - turned[2] - ratio * (turned[1] - turned[2]))
        for rack, wheel, radius in self.racks:
            on = self.slots[rack].get("on", "frame")
            turned = [self._angle(x, name) - self._angle(begun, name) for name in (wheel, on)]
            left.append(self.way(x, rack)[0] - self.way(begun, rack)[0] - radius * (turned[0] - turned[1]))
        return np.stack(left)

    def _carrier(self, wheel: str) -> str:
        """The carrier of a gear: the frame, or the first other link at its first pin."""
        pin = self.table["links"][wheel]["pins"][0]
        if pin in self.fixed:
            return "frame"
        return next(name for name in self.names if name != wheel and pin in self.table["links"][name]["pins"])

    def jacobian(self, x: np.ndarray, phi: float, begun: np.ndarray) -> np.ndarray:
        """By steps along the imaginary axis, exact to rounding."""
        many = x[:, None] + 1e-30j * np.eye(len(x))
        return np.imag(self.open(many, phi, begun[:, None].astype(complex))) * 1e30

    # ---- motion

    def closed(self, x: np.ndarray, phi: float, begun: np.ndarray) -> np.ndarray | None:
        """All positions and angles at a crank angle, near `x`; None if nothing closes there."""
        for step in range(12):
            gap = self.open(x, phi, begun)
            if np.max(np.abs(gap)) < 1e-14 * (self.size + 1) or (step > 5 and np.max(np.abs(gap)) < 1e-12 * self.size):
                return x
            move = np.linalg.lstsq(self.jacobian(x, phi, begun), -gap, rcond=None)[0]
            if not np.max(np.abs(move[2::3])) < 0.3:
                return None
            x = x + move
        return x if np.max(np.abs(self.open(x, phi, begun))) < 1e-11 * self.size else None

    def begun(self) -> np.ndarray:
        """The machine as drawn, closed by its lengths."""
        x = self.start()
        found = self.closed(x, 0.0, x)
        assert found is not None
        return found

    def spots_at(self, x: np.ndarray) -> dict[str, complex]:
        """The positions of all points of links."""
        return {
            point: complex(*(float(part) for part in self._point(x, name, point)))
            for name in self.names
            for point in self.bars[name].points
        }

    def walk(self, upto: float) -> tuple[list[tuple[float, np.ndarray]], float | None]:
        """Crank angles and configurations from zero to `upto` (of either sign), and the fold that ends the way."""
        x = self.begun()
        begun, path, step = x, [(0.0, x)], math.copysign(STEP, upto)
        while abs(path[-1][0]) < abs(upto) - 1e-12:
            phi, x = path[-1]
            whole = phi + step if abs(phi + step) < abs(upto) else upto
            guess = x
            if len(path) > 1:
                before, old = path[-2]
                guess = x + (x - old) * ((whole - phi) / (phi - before))
            new = self.closed(guess, whole, begun)
            if new is not None and np.max(np.abs((new - guess)[2::3])) < 0.1:
                path.append((whole, new))
            elif abs(step) < NEAR:
                return path, self._fold(*path[-1], begun)
            else:
                step /= 2
        return path, None

    def _fold(self, phi: float, x: np.ndarray, begun: np.ndarray) -> float:
        """The crank angle near `phi` at which two assembly modes coincide."""
        null = np.linalg.svd(self.jacobian(x, phi, begun))[2][-1]
        count = len(x)

        def left(z):
            at, v, angle = z[:count], z[count:-1], z[-1]
            rows = np.concatenate([self.open(at, angle, begun), self.jacobian(at, angle, begun) @ v, [v @ null - 1]])
            return rows

        found = root(left, np.concatenate([x, null, [phi]]), tol=1e-13)
        assert abs(found.x[-1] - phi) < 100 * NEAR
        return float(found.x[-1])


def circles(one, reach, other, far, side: int):
    """Intersection of two circles, to the left (+1) or right (-1) of the line from the first centre to the second."""
    line = other - one
    apart = np.abs(line)
    foot = (apart**2 + reach**2 - far**2) / (2 * apart)
    return one + line / apart * (foot + 1j * side * np.sqrt(reach**2 - foot**2))
