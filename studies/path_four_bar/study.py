"""Synthesis of four-bars: y = x² as a function, a rocker with given swing and time ratio, a path through five points.

Run: python -m studies.path_four_bar.study [OUT]       tables on the screen, two figures in OUT (default: here)
"""

import sys
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import linkjax as lj
from benchmarks.synthesis import FIVE, five, shortest
from linkjax.design import Optimum
from linkjax.measures import Parts

HERE = Path(__file__).parent
RANGE = np.radians(60.0)  # of crank and rocker
LENGTHS = ("crank", "coupler", "rocker")
TRANSMISSION = "min_transmission_angle >= 40 deg"
EVEN = (np.arange(41) + 0.5) / 41  # travelled shares of the crank's range, for least squares
EQUAL = np.pi * np.arange(241) / 240  # equally spaced angles (rad) of the crank's motion law, for minimax
FINE = np.pi * np.arange(2001) / 2000
SWING, TIME_RATIO = np.radians(60.0), 1.2
BLUE, VERMILION, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#8a8a8a"


class Generator(NamedTuple):
    """A four-bar that generates the function: lengths (frame 1), angles (rad) of crank and rocker at x = 1."""

    crank: float
    coupler: float
    rocker: float
    crank_start: float
    rocker_start: float
    side: int


# --- function generation ---------------------------------------------------------------------------------------------


def share(phi):
    """Travelled share of the crank's range, x - 1, at the angle φ (rad) of its motion law."""
    return 0.5 - 0.5 * np.cos(phi)


def wanted(s):
    """Rotation of the rocker (rad) for y = x², 1 <= x = 1 + s <= 2, 1 <= y <= 4."""
    return RANGE * ((1 + s) ** 2 - 1) / 3


def scene(of: Generator) -> lj.Scene:
    """The crank oscillates over its range, so that the four-bar must be assembled only there."""
    crank = lj.Crank("crank", "A", "B", phase=of.crank_start, law=lj.Harmonic(0.0, RANGE))
    groups = [crank, lj.RRR(("coupler", "rocker"), "B", "D", "C", of.side)]
    links = {name: lj.Link(getattr(of, name)) for name in LENGTHS}
    return lj.Scene(lj.Mechanism({"A": lj.Vec(0.0, 0.0), "D": lj.Vec(1.0, 0.0)}, links, groups), speed=1.0)


def differences(scene, start, phi):
    """Rocker angle minus the wanted one (rad) at angles of the motion law, within half a turn."""
    u = Parts(scene).machine.sample(jnp.asarray(phi), dynamics=False).pose.links["rocker"].u
    angle = wanted(share(phi)) + start
    x, y, c, s = u.x[: len(phi)], u.y[: len(phi)], jnp.cos(angle), jnp.sin(angle)
    return jnp.atan2(c * y - s * x, c * x + s * y)


def both_signs(scene, own):
    """The differences and the same with the other sign: the largest entry is the largest magnitude."""
    error = differences(scene, own["rocker_start"], EQUAL)
    return jnp.concatenate([error, -error])


def structural_error(of: Generator) -> np.ndarray:
    """Structural error (degrees) at the angles FINE of the motion law."""
    return np.degrees(jax.jit(lambda at, start: differences(at, start, FINE))(scene(of), of.rocker_start))


def generator(found: Optimum, side: int) -> Generator:
    """The four-bar that an optimisation found."""
    x = {name: after for name, (_, after) in found.variables.items()}
    crank, coupler, rocker = (x[f"links.{name}.length"] for name in LENGTHS)
    return Generator(crank, coupler, rocker, x["groups.crank.phase"], x["own.rocker_start"], side)


def least_squares(side: int, starts: int = 12) -> Optimum:
    """The least sum of squares in the middle of 41 equal parts of the range."""
    angles = np.arccos(1 - 2 * EVEN)
    goal = lj.function_error("rocker", angles, wanted(EVEN), offset="own.rocker_start")
    first = Generator(1.5, 1.5, 1.5, np.pi / 2, np.pi, side)
    return lj.optimise(scene(first), free(), goal, limits=[TRANSMISSION], starts=starts)


def least_largest(of: Generator, starts: int = 1) -> Optimum:
    """The least largest magnitude at 241 places with Chebyshev spacing; the first start is a given four-bar."""
    goal = lj.design.as_rows(both_signs, "rad")
    return lj.optimise(scene(of), free(of.rocker_start), goal, limits=[TRANSMISSION], starts=starts)


def free(rocker_start: float = np.pi) -> dict:
    """Three lengths and both initial angles; the frame has length 1."""
    lengths = {f"links.{name}.length": (0.2, 5.0) for name in LENGTHS}
    start = {"range": "0 to 360 deg", "initial": f"{rocker_start % (2 * np.pi)} rad"}
    return {**lengths, "groups.crank.phase": "0 to 360 deg", "own.rocker_start": start}


def precision_points(crank_start: float, rocker_start: float) -> Generator | None:
    """Freudenstein's equation, K1 cos ψ - K2 cos φ + K3 = cos(φ - ψ), at three points with Chebyshev spacing.

    It is linear in K1 = 1/a, K2 = 1/c, K3 = (a² - b² + c² + 1)/(2 a c). A negative length is a bar turned by half a
    turn. None if there is no such four-bar, or if the three points belong to different assembly modes.
    Source: F. Freudenstein, Approximate synthesis of four-bar linkages, Trans. ASME 77 (1955) 853-861.
    """
    s = 0.5 - 0.5 * np.cos(np.pi * np.array([1, 3, 5]) / 6)
    phi, psi = crank_start + RANGE * s, rocker_start + wanted(s)
    k1, k2, k3 = np.linalg.solve(np.stack([np.cos(psi), -np.cos(phi), np.ones(3)], 1), np.cos(phi - psi))
    if min(abs(k1), abs(k2)) < 1e-6:
        return None
    a, c = 1 / k1, 1 / k2
    square = a * a + c * c + 1 - 2 * a * c * k3
    if square <= 0:
        return None
    b = np.stack([a * np.cos(phi), a * np.sin(phi)])
    to_d, to_c = np.array([[1.0], [0.0]]) - b, np.stack([1 + c * np.cos(psi), c * np.sin(psi)]) - b
    left = to_d[0] * to_c[1] - to_d[1] * to_c[0] > 0
    first, second = (start + np.pi * (bar < 0) for start, bar in ((crank_start, a), (rocker_start, c)))
    found = Generator(abs(a), np.sqrt(square), abs(c), first, second, 1 if left[0] else -1)
    return found if left.all() or not left.any() else None


def by_textbook(step: int = 15, least: float = np.radians(40.0)) -> Generator:
    """The best of the designs with three precision points whose initial angles are multiples of `step` degrees, with
    the bounds of the optimisation: lengths, smallest transmission angle."""
    best, largest = None, np.inf
    starts = np.radians(np.arange(0, 360, step))
    for one in (precision_points(first, second) for first in starts for second in starts):
        if one is None or not all(0.2 <= length <= 5.0 for length in one[:3]):
            continue
        error, mu = in_closed_form(one, share(FINE[::20]))
        if mu.min() >= least and np.abs(error).max() < largest:
            best, largest = one, np.abs(error).max()
    assert best is not None
    return best


def in_closed_form(of: Generator, s):
    """Structural error and transmission angle (rad) from the triangle B D C."""
    x, y = of.crank * np.cos(of.crank_start + RANGE * s) - 1, of.crank * np.sin(of.crank_start + RANGE * s)
    far = np.hypot(x, y)
    at_d = np.arccos(np.clip((of.rocker**2 + far**2 - of.coupler**2) / (2 * of.rocker * far), -1, 1))
    at_c = np.arccos(np.clip((of.rocker**2 + of.coupler**2 - far**2) / (2 * of.rocker * of.coupler), -1, 1))
    error = np.arctan2(y, x) - of.side * at_d - of.rocker_start - wanted(s)
    return (error + np.pi) % (2 * np.pi) - np.pi, np.minimum(at_c, np.pi - at_c)


# --- a rocker with given swing and time ratio ------------------------------------------------------------------------


def crank_rocker(starts: int = 10) -> Optimum:
    """The four-bar with the largest smallest transmission angle."""
    bars = {"links.crank.length": (0.1, 0.9), "links.coupler.length": (0.3, 2.0), "links.rocker.length": (0.3, 2.0)}
    limits = [
        "swing.rocker >= 60 deg",
        "swing.rocker <= 60 deg",
        "time_ratio.rocker >= 1.2",
        "time_ratio.rocker <= 1.2",
    ]
    first = lj.Scene(lj.four_bar(0.4, 1.0, 0.8, 1.0), speed=1.0)
    return lj.optimise(first, bars, maximise="min_transmission_angle", limits=limits, starts=starts)


def constructed(t, arc: int):
    """Smallest transmission angle (rad), crank, coupler, rocker (frame 1) of the crank-rocker whose crank pivot A is at
    the angle t on one of the two circles from which the limit positions B1 B2 of a rocker of length 1 are seen under
    θ = 180° (K - 1)/(K + 1). Transmission angle zero where there is none.

    Source: the circle construction for a given time ratio K, VDI 2130; Norton, Design of Machinery, 2012, 3.6.
    """
    theta, half = np.pi * (TIME_RATIO - 1) / (TIME_RATIO + 1), SWING / 2
    radius = np.sin(half) / np.sin(theta)
    x, y = radius * np.cos(t), np.cos(half) + radius * (arc * np.cos(theta) + np.sin(t))  # A from D
    one, two = (np.stack([sign * np.sin(half) - x, np.cos(half) - y]) for sign in (-1, 1))  # B1, B2 from A
    far, near, frame = np.hypot(*one), np.hypot(*two), np.hypot(x, y)
    a, b = np.abs(far - near) / 2, (far + near) / 2
    cosines = [(b**2 + 1 - (frame + sign * a) ** 2) / (2 * b) for sign in (-1, 1)]
    worst = np.max(np.abs(cosines), axis=0)
    seen = np.abs(np.sum(one * two, axis=0) - np.cos(theta) * far * near) < 1e-9
    same_mode = (one[0] * y - one[1] * x) * (two[0] * y - two[1] * x) > 0
    exists = seen & same_mode & (worst < 1)
    return np.where(exists, np.arccos(np.clip(worst, 0, 1)), 0.0), a / frame, b / frame, 1 / frame


def best_constructed(places: int = 20001) -> tuple[float, ...]:
    """The best of both circles: the best of many places, three times, each time between the neighbours of the last."""
    found = []
    for arc in (-1, 1):
        low, high = 0.0, 2 * np.pi
        for _ in range(3):
            t = np.linspace(low, high, places)
            top, step = t[np.argmax(constructed(t, arc)[0])], t[1] - t[0]
            low, high = top - step, top + step
        found.append(tuple(float(each) for each in constructed(0.5 * (low + high), arc)))
    return max(found)


# --- a path through five points --------------------------------------------------------------------------------------


def five_points(starts: int = 3) -> Optimum:
    """The four-bar of the benchmark whose coupler point passes nearest to five points."""
    machine, bounds, goal = five()
    return lj.optimise(machine, bounds, goal, limits=shortest(), starts=starts)


# --- figures and tables ----------------------------------------------------------------------------------------------


def draw_functions(designs: dict[str, Generator], path: Path) -> None:
    """The function, and the structural errors of three designs."""
    figure, (function, coarse, fine) = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    x = 1 + share(FINE)
    function.plot(x, np.degrees(wanted(x - 1)), color=GREEN, label="y = x²")
    for (name, design), colour in zip(designs.items(), (GREY, VERMILION, BLUE), strict=True):
        error = structural_error(design)
        coarse.plot(x, error, color=colour, label=name)
        if colour != GREY:
            fine.plot(x, 1000 * error, color=colour, label=name)
    some = slice(None, None, 200)
    reached = np.degrees(wanted(x - 1)) + structural_error([*designs.values()][-1])
    function.plot(x[some], reached[some], "o", color=BLUE, label="four-bar of the least largest error")
    function.set(title="function", ylabel="rotation of the rocker [°]")
    coarse.set(title="structural error", ylabel="[°]")
    fine.set(title="the same, optimised designs", ylabel="[0.001°]")
    for axes in (function, coarse, fine):
        axes.set(xlabel="x", xlim=(1, 2))
        axes.legend(frameon=False)
    for axes in (coarse, fine):
        axes.axhline(0.0, color="black", linewidth=0.6)
    figure.savefig(path, dpi=110)


def draw_bars(rocker: lj.Scene, path_maker: lj.Scene, path: Path) -> None:
    """The crank-rocker at both limit positions, and the coupler curve through the five points."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.6), layout="constrained")
    for angle, colour in zip(limit_angles(rocker), (BLUE, VERMILION), strict=True):
        at = points_at(rocker, np.array([angle]))
        left.plot(*np.hstack([at[p] for p in "ABCD"]), "o-", color=colour, label=f"crank at {np.degrees(angle):.1f}°")
    turn = np.linspace(0, 2 * np.pi, 361)
    left.plot(*points_at(rocker, turn)["B"], color=GREY, linewidth=0.8)
    left.plot(*points_at(rocker, turn)["C"], color=GREY, linewidth=0.8)
    left.set(title="Limit positions: swing 60°, time ratio 1.2", aspect="equal", xlabel="x", ylabel="y")
    left.legend(frameon=False, loc="lower right")
    right.plot(*points_at(path_maker, turn)["E"], color=BLUE, label="coupler curve")
    at = points_at(path_maker, np.radians([60.0]))
    right.plot(*np.hstack([at[p] for p in "ABCD"]), "o-", color=GREY, label="four-bar at 60°")
    right.fill(*np.hstack([at[p] for p in "BCE"]), color=GREY, alpha=0.3)
    right.plot(*np.transpose(FIVE), "o", color=VERMILION, label="five points")
    right.set(title="Path through five points", aspect="equal", xlabel="x", ylabel="y")
    right.set_ylim(-1.3, 4.3)
    right.legend(frameon=False, loc="lower center", ncols=3, fontsize="small", columnspacing=1.0)
    figure.savefig(path, dpi=110)


def limit_angles(scene: lj.Scene) -> np.ndarray:
    """Crank angles (rad) of the limit positions of the rocker."""
    found = lj.analyse(scene, angles=36).dead_centres["rocker"]
    return np.asarray(found.angle)[np.asarray(found.true)]


def points_at(scene: lj.Scene, angles: np.ndarray) -> dict[str, np.ndarray]:
    """Positions of all points at crank angles, shape (2, angles)."""
    points = jax.vmap(lambda phi: lj.pose(scene.mechanism, phi).points)(jnp.asarray(angles))
    flat = np.zeros_like(angles)
    return {name: np.stack([at.r.x + flat, at.r.y + flat]) for name, at in points.items()}


def row_of(name: str, of: Generator) -> str:
    """A row of the first table: errors in degrees, lengths with the frame as 1, initial angles in degrees."""
    error = structural_error(of)
    rms = np.sqrt(np.trapezoid(error**2, share(FINE)))
    mu = np.degrees(in_closed_form(of, share(FINE))[1].min())
    lengths = " | ".join(f"{each:.6f}" for each in of[:3])
    starts = " | ".join(f"{np.degrees(each) % 360:.5f}" for each in (of.crank_start, of.rocker_start))
    return f"| {name} | {rms:.6f} | {np.abs(error).max():.6f} | {mu:.1f} | {lengths} | {starts} |"


def report(found: Optimum) -> str:
    """How an optimisation ended."""
    reached = f"{found.starts_at_optimum} of {len(found.starts)} starts"
    return f"KKT residual {found.kkt_residual:.0e}, {reached}, {found.evaluations} evaluations"


def main(out: Path = HERE) -> None:
    """Print the tables and draw the figures."""
    lj.enable_x64()
    designs = {"three precision points": by_textbook()}
    print(row_of("three precision points", designs["three precision points"]))
    for side, mode in ((-1, ""), (1, ", other assembly mode")):
        squares = least_squares(side)
        start = generator(squares, side)
        minimax = least_largest(start, 1 if mode else 12)
        best = generator(minimax, side)
        for name, each, found in (("least squares", start, squares), ("least largest error", best, minimax)):
            print(row_of(name + mode, each), report(found), sep="\n")
            if not mode:
                designs[name] = each
    best = designs["least largest error"]
    again = precision_points(best.crank_start, best.rocker_start)
    assert again is not None
    print(row_of("three precision points, these initial angles", again))

    rocker = crank_rocker()
    lengths = [rocker.variables[f"links.{name}.length"][1] for name in LENGTHS]
    print()
    for name, row in (("linkjax", (rocker.objective, *lengths)), ("construction", best_constructed())):
        print(f"| {name} | {np.degrees(row[0]):.6f} | " + " | ".join(f"{each:.6f}" for each in row[1:]) + " |")
    print(report(rocker))

    path = five_points()
    print(f"\nsum of squares {path.objective:.4e}, {report(path)}")
    for name, (_, after) in path.variables.items():
        print(f"| `{name}` | {after:.6f} |")
    out.mkdir(parents=True, exist_ok=True)
    draw_functions(designs, out / "function.png")
    draw_bars(rocker.after, path.after, out / "mechanisms.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
