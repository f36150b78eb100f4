"""The built-in machines by separate formulas: their positions, structure and results."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.analysis import document
from linkjax.forces import kinetostatics
from linkjax.kinematics import pose, prepared

FORMULAS = {
    "scissor-lift": ("I1+III3(0,1,2,3,4,5)", 5),  # with the cylinder fixed: the brace with three others on the frame
    "stephenson-3": ("I1(0,1) → II1(2,3) → II1(4,5)", 5),
    "andrews-squeezer": ("I1(0,1) → II1(2,3) → {II1(4,5); II1(6,7)}", 7),
    "geared-press": ("I1(0,1) → G(2) → II1(3,4) → II2(5,6)", 6),
    "toggle-press": ("I1(0,1) → II1(2,3) → II2(4,5)", 5),
    "two-cylinder": ("I1(0,1) → {II2(2,3); II2(4,5)}", 5),
    "oscillating-cylinder": ("I1(0,1) → II3(2,3)", 3),
    "elliptic-trammel": ("I1+II4(0,1,2,3)", 3),  # with the motor fixed: sliding block and bar as one on a guide; shoe
    "two-slider-press": ("I1(0,1) → {II2(2,4); II2(3,5)}", 5),
    "combine-cutter": ("I1(0,1) → II1(2,3) → II3(4,5)", 5),
    "combine-shoe": ("I1(0,1) → II1(2,3) → II1(4,5)", 5),
    "kozhevnikov-press": (
        f"I1(0,1) → {{{'; '.join(f'II1({n},{n + 1}) → II2({n + 2},{n + 3})' for n in (2, 6, 10, 14))}}}",
        17,
    ),
}
PHI = np.linspace(0.0, 2 * np.pi, 25)[:-1] + 0.1


def poses(scene: lj.Scene, phi=PHI):
    """The pose at crank angles, leaves of their shape."""
    return compiled_soon(jax.vmap(lambda mechanism, phi: pose(mechanism, phi), (None, 0)))(
        prepared(scene.mechanism), jnp.asarray(phi)
    )


def three(point) -> np.ndarray:
    """x and y of a point with their first and second derivatives, shape (3, 2, angles)."""
    return np.array([[v.x, v.y] for v in (point.r, point.dr, point.ddr)])


def derivatives(curve, phi=PHI) -> np.ndarray:
    """A curve of the crank angle, its first and second derivative by JAX, shape (3, 2, angles)."""
    first, second = jax.jacfwd(curve), jax.jacfwd(jax.jacfwd(curve))
    return np.array([jax.vmap(f)(jnp.asarray(phi)).T for f in (curve, first, second)])


@pytest.mark.parametrize("name", FORMULAS)
def test_structure(name):
    found = lj.structure(lj.load(name).mechanism)
    formula, links = FORMULAS[name]
    assert len(found.links) == links and found.mobility == 1
    gears = sum(pair.letter == "G" for pair in found.pairs)
    assert 3 * links - 2 * (len(found.pairs) - gears) - gears == 1
    assert found.formula(numbers=True) == formula


@pytest.mark.slow
def test_elliptic_trammel():
    """The ends stay on their axes; the pen Q draws an ellipse of half axes 120 and 420 mm."""
    scene = lj.load("elliptic-trammel")
    here, turn = poses(scene), 2 * np.pi / 3
    exact = {
        "X": lambda phi: jnp.stack([-0.3 * jnp.cos(phi + turn), 0 * phi]),
        "Y": lambda phi: jnp.stack([0 * phi, 0.3 * jnp.sin(phi + turn)]),
        "Q": lambda phi: jnp.stack([0.12 * jnp.cos(phi + turn), 0.42 * jnp.sin(phi + turn)]),
    }
    for point, curve in exact.items():
        np.testing.assert_allclose(three(here.points[point]), derivatives(curve), atol=1e-13)


def test_oscillating_cylinder():
    """The barrel points from the trunnion to the crank pin; the rod is there, in its direction."""
    here = poses(lj.load("oscillating-cylinder"))

    def piston(phi):
        pin, trunnion = 0.09 * jnp.stack([jnp.cos(phi), jnp.sin(phi)]), jnp.array([0.5, 0.06])
        along = pin - trunnion
        return pin - 0.3 * along / jnp.sqrt(along @ along)

    np.testing.assert_allclose(three(here.points["K"]), derivatives(piston), atol=1e-13)


def test_two_slider_press():
    """Two slider-cranks in line, one the mirror image of the other, half a turn later."""
    here = poses(lj.load("two-slider-press"))

    def ram(sign):
        return lambda phi: jnp.stack(
            [0.11 * jnp.cos(phi) + sign * jnp.sqrt(0.48**2 - (0.11 * jnp.sin(phi)) ** 2), 0 * phi]
        )

    for point, sign in (("D", 1), ("E", -1)):
        np.testing.assert_allclose(three(here.points[point]), derivatives(ram(sign)), atol=1e-13)


def test_geared_press():
    """The rods mirror each other, so they meet on the middle line; a static force on the ram is shared equally."""
    scene = lj.load("geared-press")
    here = poses(scene)

    def pin(phi):
        across = 0.15 - 0.06 * jnp.cos(phi)
        return jnp.stack([0 * phi, 0.06 * jnp.sin(phi) - jnp.sqrt(0.42**2 - across**2)])

    def ram(phi):
        return pin(phi) - jnp.array([0.0, 0.18])

    for point, curve in (("P", pin), ("Q", ram)):
        np.testing.assert_allclose(three(here.points[point]), derivatives(curve), atol=1e-13)
    held = lj.Force("held", "ram", point="Q", force=lj.Vec(0.0, 1000.0))
    still = lj.Scene(scene.mechanism, (held,), speed=scene.speed)
    found = compiled_soon(jax.vmap(lambda phi: kinetostatics(still, phi, 0 * phi, 0 * phi)))(jnp.asarray(PHI))
    lean = 0.5 * 1000.0 * 0.42 / np.sqrt(0.42**2 - (0.15 - 0.06 * np.cos(PHI)) ** 2)  # along either rod
    np.testing.assert_allclose(found.reactions["B"]["left"].magnitude, lean, rtol=1e-12)
    np.testing.assert_allclose(found.reactions["C"]["right"].magnitude, lean, rtol=1e-12)
    np.testing.assert_allclose(found.reactions["ram.guide"]["ram"].magnitude, 0.0, atol=1e-9)
    slope = derivatives(ram)[1][1]
    np.testing.assert_allclose(found.drive_torque, -1000.0 * slope, atol=1e-10)
    # the teeth carry half of it from crank to gear
    tangential = np.abs(found.reactions["wheel.mesh"]["wheel"].moment) / 0.15
    np.testing.assert_allclose(tangential, 0.5 * 1000.0 * np.abs(slope) / 0.15, atol=1e-8)


@pytest.mark.slow
def test_toggle_press():
    """The arms are in line with an unbounded force ratio: ram force over knee force is 1 / (2 tan θ), and the static
    drive torque for a ram force is that ratio times the moment arm of the knee."""
    scene = lj.load("toggle-press")
    force = 1000.0
    load = lj.Force("held", "ram", "P", force=lj.Vec(0.0, -force))
    from_loads = lj.Scene(scene.mechanism, (load,), speed=scene.speed)
    here = poses(scene)
    torque = -np.asarray(jax.vmap(lambda phi: lj.reduced_model(from_loads, phi).torque)(jnp.asarray(PHI)))
    b, k = (np.stack([here.points[p].r.x, here.points[p].r.y]) for p in ("B", "K"))
    theta = np.arctan2(k[0], -k[1])  # of the upper arm from the vertical
    # the ram pushes up through the lower arm; about D it is force 2 tan θ at the knee, sideways; the rod holds it there
    sideways = 2 * force * np.tan(theta) * 0.25 * np.cos(theta)
    rod = (k - b) / np.hypot(*(k - b))
    push = -sideways / (k[0] * rod[1] - k[1] * rod[0])
    drive = -push * (rod[0] * (b[1] + 0.248) - rod[1] * (b[0] + 0.45))
    np.testing.assert_allclose(np.abs(torque), np.abs(drive), rtol=1e-9)
    np.testing.assert_allclose(np.asarray(here.points["P"].r.y), -0.5 * np.cos(theta), atol=1e-13)


def test_andrews_squeezer_at_the_published_start():
    """With the published angles of the bodies at the start every joint is at its position, and the published mass
    matrix with the published constraints gives its reduced inertia (Schiehlen 1990; Hairer and Wanner 1996, VII.7)."""
    scene = lj.load("andrews-squeezer")
    q = (
        -0.06171389001427645, 0.0, 0.45527981916307037, 0.22266839016588588, 0.48736497954384256, -0.22266839016588588,
        1.2305474445498212,
    )  # fmt: skip
    theta, phi, omega = q[1], q[3], q[5]
    rr, d, ss, e, zf, u, zt = 0.007, 0.028, 0.035, 0.02, 0.02, 0.04, 0.04
    a, b = jnp.array([-0.06934, -0.00227]), jnp.array([-0.03635, 0.03273])

    def at(angle, length):
        return length * jnp.stack([jnp.cos(angle), jnp.sin(angle)])

    def joints(q):
        """F, E via K2, E minus E via K3, K5 and K4, K7 and K6; then G, H, D."""
        beta, theta, gamma, phi, delta, omega, epsilon = q
        quarter = np.pi / 2
        f = at(beta, rr)
        end = f - at(beta + theta, d)
        k3 = b + at(gamma - quarter, ss)
        g = a + at(delta, zt)
        h = a + at(epsilon - quarter, u)
        closing = jnp.concatenate([end - k3, end - g - at(phi + delta - quarter, e), end - h - at(omega + epsilon, zf)])
        return closing, {"F": f, "E": end, "G": g, "H": h, "D": b + at(gamma - quarter, 0.018) + at(gamma, 0.02)}

    closing, exact = joints(jnp.array(q))
    np.testing.assert_allclose(closing, 0.0, atol=1e-15)
    here = poses(scene, np.zeros(1))
    for point, place in exact.items():
        np.testing.assert_allclose([here.points[point].r.x[0], here.points[point].r.y[0]], place, atol=1e-14)

    m1, m2, m3, m4, m5, m6, m7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.0705, 0.00706, 0.05498
    i1, i2, i3, i4, i5, i6, i7 = 2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
    ra, da, sa, sb, ta, tb, ua, ub = 0.00092, 0.0115, 0.01874, 0.01043, 0.02308, 0.00916, 0.01228, 0.00449
    ea = fa = 0.01421
    mass = np.zeros((7, 7))
    mass[0, 0] = m1 * ra**2 + m2 * (rr**2 - 2 * da * rr * math.cos(theta) + da**2) + i1 + i2
    mass[1, 0] = mass[0, 1] = m2 * (da**2 - da * rr * math.cos(theta)) + i2
    mass[1, 1] = m2 * da**2 + i2
    mass[2, 2] = m3 * (sa**2 + sb**2) + i3
    mass[3, 3] = m4 * (e - ea) ** 2 + i4
    mass[4, 3] = mass[3, 4] = m4 * ((e - ea) ** 2 + zt * (e - ea) * math.sin(phi)) + i4
    mass[4, 4] = m4 * (zt**2 + 2 * zt * (e - ea) * math.sin(phi) + (e - ea) ** 2) + m5 * (ta**2 + tb**2) + i4 + i5
    mass[5, 5] = m6 * (zf - fa) ** 2 + i6
    mass[6, 5] = mass[5, 6] = m6 * ((zf - fa) ** 2 - u * (zf - fa) * math.sin(omega)) + i6
    mass[6, 6] = m6 * ((zf - fa) ** 2 - 2 * u * (zf - fa) * math.sin(omega) + u**2) + m7 * (ua**2 + ub**2) + i6 + i7
    slopes = np.asarray(jax.jacfwd(lambda q: joints(q)[0])(jnp.array(q)))
    rates = np.concatenate([[1.0], np.linalg.solve(slopes[:, 1:], -slopes[:, 0])])
    assert float(lj.reduced_model(scene, jnp.asarray(0.0)).inertia) == pytest.approx(rates @ mass @ rates, rel=1e-11)


@pytest.mark.slow
def test_kozhevnikov_press_is_four_times_the_same():
    """Each ram has the motion of the previous one a quarter of a turn later."""
    scene = lj.load("kozhevnikov-press")
    quarter = np.pi / 2
    outwards = []
    for i, (x, y) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
        ram = poses(scene, PHI + i * quarter).points[f"P{i + 1}"]
        outwards.append([x * np.asarray(v.x) + y * np.asarray(v.y) for v in (ram.r, ram.dr, ram.ddr)])
    for other in outwards[1:]:
        np.testing.assert_allclose(other, outwards[0], atol=1e-12)
    assert np.ptp(outwards[0][0]) > 0.1


@pytest.mark.slow
def test_kozhevnikov_peaks_agree():
    """The ram forces reach the same peak; all loads are equal, but weights act on each in its own direction."""
    scene = lj.load("kozhevnikov-press", {"gravity": 0})
    found = document(lj.analyse(scene, angles=360, constant_speed=True), "kozhevnikov-press", lj.__version__)
    reactions = found["forces"]["reactions"]
    peaks = [
        np.hypot(*(np.asarray(reactions[f"P{i + 1}"][f"ram{4 * i + 5}"][axis], float) for axis in ("fx", "fy"))).max()
        for i in range(4)
    ]
    np.testing.assert_allclose(peaks, peaks[0], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(FORMULAS))
def test_analyse(name):
    """Every machine runs (or follows its law) and its checks are satisfied."""
    cycle = lj.analyse(lj.load(name))
    assert int(cycle.result) == 0
    assert float(cycle.checks.virtual_power) < 1e-8 and float(cycle.checks.force_balance) < 1e-8
    target = cycle.scene.target_delta
    if target is not None:
        assert 0.2 < float(cycle.delta / target) < 5
