"""The study of four-bar synthesis: the numbers of its README by closed forms, and that the program finds them."""

import re

import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.synthesis import FIVE
from studies.path_four_bar import study

TEXT = (study.HERE / "README.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in row.strip("|").split("|")] for row in re.findall(r"^\|.*\d.*\|$", TEXT, re.M)]
NUMBERS = {row[0]: [float(cell) for cell in row[1:]] for row in ROWS if re.match(r"[\d.]+$", row[-1])}
FUNCTIONS = [name for name, numbers in NUMBERS.items() if len(numbers) == 8]
X = np.linspace(1, 2, 4001)


def rocker_error(lengths, starts, left, x=X):
    """Structural error (degrees) and the least transmission angle: circles about B and D, frame 1."""
    a, b, c = lengths
    phi = starts[0] + np.radians(60) * (x - 1)
    pin = a * np.exp(1j * phi)
    off = 1 - pin
    along = (b**2 - c**2 + np.abs(off) ** 2) / (2 * np.abs(off))
    joint = pin + off / np.abs(off) * (along + (1j if left else -1j) * np.sqrt(b**2 - along**2))
    wanted = np.exp(1j * (starts[1] + np.radians(60) * (x**2 - 1) / 3))
    mu = np.abs(np.angle((pin - joint) / (1 - joint)))
    return np.degrees(np.angle((joint - 1) / wanted)), np.degrees(np.minimum(mu, np.pi - mu).min())


def of(name):
    """Lengths and initial angles (rad) in the README, and the assembly mode."""
    return NUMBERS[name][3:6], np.radians(NUMBERS[name][6:]), "other" in name


@pytest.mark.parametrize("name", FUNCTIONS)
def test_errors_of_the_function(name):
    """Rounded dimensions: 5e-7 of lengths and 5e-6 degrees of angles change the error by up to 1e-4 degrees."""
    error, mu = rocker_error(*of(name))
    rms, largest, least = NUMBERS[name][:3]
    assert np.sqrt(np.trapezoid(error**2, X)) == pytest.approx(rms, abs=1e-4)
    assert np.abs(error).max() == pytest.approx(largest, abs=1e-4)
    assert mu == pytest.approx(least, abs=0.05 + 1e-4)  # written with one decimal
    bars = sorted([*NUMBERS[name][3:6], 1.0])
    assert bars[0] + bars[3] > bars[1] + bars[2]  # no link rotates fully (Grashof)


@pytest.mark.parametrize("name", ["least squares", "least squares, other assembly mode"])
def test_least_squares(name):
    """SciPy, from the dimensions of the README: the same root mean square, and no lower one from there."""
    lengths, starts, left = of(name)
    x = 1 + (np.arange(41) + 0.5) / 41
    found = least_squares(
        lambda p: rocker_error(p[:3], p[3:], left, x)[0], [*lengths, *starts], x_scale="jac", xtol=1e-14, ftol=1e-14
    )
    error = rocker_error(found.x[:3], found.x[3:], left)[0]
    assert np.sqrt(np.trapezoid(error**2, X)) == pytest.approx(NUMBERS[name][0], abs=2e-6)
    np.testing.assert_allclose(found.x, [*lengths, *starts], atol=2e-5)


@pytest.mark.parametrize("name", ["least largest error", "least largest error, other assembly mode"])
def test_equal_extremes(name):
    """Six extremes of alternating sign, and no four-bar nearby is better: the signs are those of the only combination
    of the six gradients that is zero. Three rounds of Remez' exchange find the exact optimum over the continuous range,
    which the README reaches within 0.1 % (its 241 places) and its last digit."""
    lengths, starts, left = of(name)
    error = rocker_error(lengths, starts, left)[0]

    def at(p, places):
        return rocker_error(p[:3], p[3:], left, X[places])[0]

    def levelled(z, places):
        return 1e3 * (at(z[:5], places) - z[5] * (-1.0) ** np.arange(6))

    places = np.zeros(6, dtype=int)
    z = np.array([*lengths, *starts, rocker_error(lengths, starts, left)[0][0]])
    for _ in range(3):
        error = rocker_error(z[:3], z[3:5], left)[0]
        places = np.array([0, *np.flatnonzero(np.diff(np.sign(np.diff(error)))) + 1, X.size - 1])
        z = least_squares(levelled, z, args=(places,), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        assert places.shape == (6,) and np.abs(levelled(z, places)).max() < 1e-8
    np.testing.assert_allclose(z[:5], [*lengths, *starts], atol=2e-3)
    assert abs(z[5]) - 6e-7 <= NUMBERS[name][1] <= 1.001 * abs(z[5]) + 6e-7
    p, step = z[:5], 1e-6
    gradients = np.stack([(at(p + step * e, places) - at(p - step * e, places)) / (2 * step) for e in np.eye(5)])
    weights = np.linalg.svd(gradients)[2][-1] * (-1.0) ** np.arange(6)
    assert np.all(weights > 0) or np.all(weights < 0)


def test_three_precision_points():
    """The error is zero at the three points."""
    design = study.by_textbook()
    bars, angles = design[:3], design[3:5]
    points = 1.5 - 0.5 * np.cos(np.pi * np.array([1, 3, 5]) / 6)
    np.testing.assert_allclose(rocker_error(bars, angles, design.side > 0, points)[0], 0, atol=1e-11)
    name = "three precision points"
    np.testing.assert_allclose([*bars, *np.degrees(angles)], NUMBERS[name][3:], atol=6e-7)
    error = rocker_error(bars, angles, design.side > 0)[0]
    assert np.abs(error).max() == pytest.approx(NUMBERS[name][1], abs=6e-7)
    again = study.precision_points(*of("least largest error")[1])
    assert again is not None
    np.testing.assert_allclose(again[:3], NUMBERS[f"{name}, these initial angles"][3:6], atol=2e-5)


def crank_rocker(a, guess):
    """Coupler and rocker (frame 1) for a crank length, from the limit positions, and the transmission angle."""

    def at_limits(bars):
        b, c = bars
        cosines = [((b + s * a) ** 2 + 1 - c**2) / (2 * (b + s * a)) for s in (1, -1)]  # angles at A
        crank = np.arccos(cosines)
        rocker = np.arccos([(1 + c**2 - (b + s * a) ** 2) / (2 * c) for s in (1, -1)])  # angles at D
        k = (np.pi + abs(crank[1] - crank[0])) / (np.pi - abs(crank[1] - crank[0]))
        return abs(rocker[0] - rocker[1]) - np.pi / 3, k - 1.2

    b, c = least_squares(at_limits, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    assert np.abs(at_limits((b, c))).max() < 1e-10
    worst = max(abs(b**2 + c**2 - (1 + s * a) ** 2) / (2 * b * c) for s in (1, -1))
    return np.degrees(np.arccos(worst)), b, c


def test_swing_and_time_ratio():
    """The construction against the law of cosines, maximised over the crank length."""
    ours, built = NUMBERS["linkjax"], study.best_constructed()
    np.testing.assert_allclose([np.degrees(built[0]), *built[1:]], NUMBERS["construction"], atol=6e-7)
    np.testing.assert_allclose(ours, NUMBERS["construction"], atol=1.1e-6)
    mu, a, b, c = ours
    assert crank_rocker(a, (b, c)) == pytest.approx((mu, b, c), abs=2e-6)
    others = [crank_rocker(a + step, (b, c))[0] for step in np.linspace(-0.02, 0.02, 41)]
    assert max(others) < mu + 1e-6 and min(others) < mu - 0.01


def test_path():
    """Circles about B and D; the sum of squares of a minimum changes little with rounded dimensions."""
    a, b, c, d, along, across = (NUMBERS[name][0] for name in NUMBERS if name.startswith("`"))
    pin = a * np.exp(1j * np.radians([30, 45, 60, 75, 90]))
    off = d - pin
    x = (b**2 - c**2 + np.abs(off) ** 2) / (2 * np.abs(off))
    joint = pin + off / np.abs(off) * (x + 1j * np.sqrt(b**2 - x**2))
    point = pin + (joint - pin) / b * (along + 1j * across)
    away = point - np.array(FIVE) @ [1, 1j]
    assert np.sum(np.abs(away) ** 2) == pytest.approx(7.4158e-7, rel=1e-4) and "7.4158e-07" in TEXT
    assert 5e-4 < np.abs(away).max() < 7e-4  # "within 0.7 mm"


@pytest.mark.slow
def test_the_program(capsys, tmp_path):
    """Every printed row is in the README, certified optima, and pictures."""
    study.main(tmp_path)
    printed = capsys.readouterr().out
    rows = [line for line in printed.splitlines() if line.startswith("|")]
    assert len(rows) == 14 and [row for row in rows if row not in TEXT] == []
    residuals = [float(each) for each in re.findall(r"KKT residual (\S+),", printed)]
    assert len(residuals) == 6 and max(residuals) < 1e-7
    assert all((tmp_path / name).stat().st_size < 200_000 for name in ("function.png", "mechanisms.png"))
