"""Friction tied to reactions: published digits, friction circles, Newton-Euler equations, power, gradients."""

from __future__ import annotations

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax._compile import compiled_soon
from linkjax.forces import Forces, kinetostatics, successive_approximation
from linkjax.friction import GuideFriction, MeshFriction, PinFriction, Thrust, everywhere
from linkjax.machine import ready
from tests.physics import rubbed
from tests.physics.machines import machine

FIRST = ("four-bar", "hay-press", "quick-return", "scotch-yoke", "clockwise")
LATER = ("hay-press-slider", "two-on-one-crank", "slotted-levers",
         "moving-guides", "triad", "geared", "rolling")  # fmt: skip
MACHINES = (*FIRST, *(pytest.param(name, marks=pytest.mark.slow) for name in LATER))
ANGLES = np.radians(np.arange(12) * 30.0 + 7.0)
STATES = ((1.0, 0.0), (0.8, 0.6), (1.1, -0.9))  # speeds times ω, accelerations times ω²


@compiled_soon
def forces_at(scene, phi, speed, acceleration) -> Forces:
    return jax.vmap(lambda *at: kinetostatics(scene, *at))(phi, speed, acceleration)


def forces(scene: lj.Scene, phi: float, speed: float, acceleration: float) -> Forces:
    """The forces at one angle."""
    found = forces_at(scene, *(jnp.asarray([x]) for x in (phi, speed, acceleration)))
    return jax.tree.map(lambda leaf: leaf[0], found)


def crank_slider(first=0.1, rod=0.3, friction=(), force=0.0, masses=(0.2, 0.2, 0.4)) -> lj.Scene:
    """The slider-crank of Exudyn's test data, in line on the x axis."""
    bars = [lj.Link(length=size, mass=m, inertia=m * size**2 / 12, centre=lj.Vec(size / 2, 0.0))
            for size, m in ((first, masses[0]), (rod, masses[1]))]  # fmt: skip
    links = {"crank": bars[0], "rod": bars[1], "slider": lj.Link(mass=masses[2])}
    groups = [lj.Crank("crank", "A", "B"), lj.RRP("rod", "slider", "B", "D", lj.Guide("A"))]
    load = lj.Force("push", "slider", "D", force=lj.Vec(force, 0.0))
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups)
    return lj.Scene(mechanism, (load,), speed=10 * math.pi, friction=friction)


PUBLISHED = [  # load, crank angle, T without and with friction, crank pivot, crank pin, wrist pin, guide, loss
    (0.0, 30, 3.4586776308, 3.6900154297, 69.613843988, 61.339531197, 43.579969799, -10.777963282, 7.267691296),
    (0.0, 150, -1.3375945007, -1.2321006142, 52.608215907, 43.130163942, 27.130964780, 4.083422086, 3.314188189),
    (-200.0, 30, -9.4690225880, -8.9646105647, 133.166240241, 140.441622902, 158.196249765, 22.180579884, 15.846571070),
    (
        -200.0,
        150,
        -8.4098942819,
        -7.7881490613,
        251.861472417,
        242.562524459,
        226.593212748,
        37.327761416,
        19.532702174,
    ),
]


@pytest.mark.parametrize("row", PUBLISHED)
def test_published_digits(row):
    """Two independent solutions with eight unknowns each, which agree to eleven digits."""
    force, degrees, free, torque, pivot, pin, wrist, guide, loss = row
    scene = crank_slider(force=force)
    every = everywhere(scene.mechanism, 0.1, 0.01)
    at = math.radians(degrees), 10 * math.pi, 0.0
    assert forces(scene, *at).drive_torque == pytest.approx(free, abs=1e-10)
    found = forces(dataclasses.replace(scene, friction=every), *at)
    assert bool(found.moves)
    assert found.drive_torque == pytest.approx(torque, abs=1e-10)
    on = found.reactions
    assert on["A"]["crank"].magnitude == pytest.approx(pivot, abs=1e-9)
    assert on["B"]["rod"].magnitude == pytest.approx(pin, abs=1e-9)
    assert on["D"]["rod"].magnitude == pytest.approx(wrist, abs=1e-9)
    assert on["slider.guide"]["slider"].fy == pytest.approx(guide, abs=1e-9)
    lost = [-float(one.value * one.speed) * 10 * math.pi for joint in found.friction.values() for one in joint.values()]
    assert min(lost) >= 0 and sum(lost) == pytest.approx(loss, abs=1e-9)
    assert sum(lost) == pytest.approx(10 * math.pi * float(found.drive_torque - forces(scene, *at).drive_torque))


def friction_circles(theta: float, first: float, rod: float, load: float, f0: float, radii, guide: float) -> float:
    """Torque on the crank of a light slider-crank against a load on its slider, by friction circles in closed form: the
    force along the rod is a tangent of the circles at both of its pins, and the reaction of the frame of that at the
    pivot."""
    b = first * np.array([math.cos(theta), math.sin(theta)])
    beta = math.asin(-b[1] / rod)  # the rod from B to D
    w = -first * math.cos(theta) / (rod * math.cos(beta))  # of the rod, per turn of the crank
    speed = -first * math.sin(theta) - rod * w * math.sin(beta)  # of the slider
    pull = load * math.copysign(1.0, speed)  # the rod pushes the slider forwards
    tilt = math.asin(f0 * (math.copysign(radii[1], w - 1) + math.copysign(radii[2], w)) / rod)
    # moments about B on the rod: rod x (force from the slider) + couples = 0
    for sign in (1, -1):
        angle = beta + sign * tilt
        line = np.array([math.cos(angle), math.sin(angle)])
        # on the slider: s line - load - guide = 0, with friction against the speed
        for side in (1, -1):
            size = pull / (line[0] - math.copysign(guide, speed) * side * line[1])
            on_rod = -size * line
            arm = rod * np.array([math.cos(beta), math.sin(beta)])
            couples = -f0 * abs(size) * (math.copysign(radii[1], w - 1) + math.copysign(radii[2], w))
            moment = arm[0] * on_rod[1] - arm[1] * on_rod[0] + couples
            if side * size * line[1] >= 0 and abs(moment) < 1e-12 * abs(size):
                on_crank = on_rod
                pivot = f0 * radii[0] * abs(size)
                pin = f0 * radii[1] * abs(size) * math.copysign(1.0, 1 - w)
                return -(b[0] * on_crank[1] - b[1] * on_crank[0]) + pivot + pin
    raise AssertionError("no equilibrium")


@pytest.mark.parametrize("degrees", [225.0, 25.0, 100.0, 300.0, 340.0])
def test_friction_circles(degrees):
    theta, radii = math.radians(degrees), (0.02, 0.018, 0.015)
    slides = -math.sin(theta) - math.cos(theta) * math.sin(theta) / math.sqrt(3.5**2 - math.sin(theta) ** 2)
    pins = tuple(PinFriction(p, 0.15, r) for p, r in zip("ABD", radii, strict=True))
    scene = crank_slider(0.1, 0.35, (*pins, GuideFriction("slider", 0.12)), -math.copysign(1000.0, slides), (0.0,) * 3)
    found = forces(scene, theta, 1.0, 0.0)
    known = friction_circles(theta, 0.1, 0.35, 1000.0, 0.15, radii, 0.12)
    assert found.drive_torque == pytest.approx(known, rel=1e-12)
    if degrees == 225.0:
        assert known == pytest.approx(63.43132503228998, rel=1e-9)
        free = forces(dataclasses.replace(scene, friction=()), theta, 1.0, 0.0).drive_torque
        assert free == pytest.approx(56.124178968865294, rel=1e-12)
        assert free / found.drive_torque == pytest.approx(0.8848022477899531, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("drives", [True, False])
def test_planet_around_a_fixed_gear(drives):
    """The arm turns a planet of z₂ teeth around a fixed gear of z₁ against the torque L: it needs L (1 + z₁ / (z₂ η)),
    and where the planet drives the arm, this takes L (1 + η z₁ / z₂)."""
    torque, share, (z2, z1) = (-3.0 if drives else 3.0), 0.9, (20, 40)
    links = {"arm": lj.Link(length=0.1), "planet": lj.Link(length=0.0)}
    groups = (lj.Crank("arm", "A", "B"), lj.Gear("planet", "B", lj.Teeth((z2, z1)), "frame", "A", carrier="arm"))
    mechanism = lj.Mechanism({"A": lj.Vec(0.0, 0.0)}, links, groups)
    rubs = (MeshFriction("planet", share),)
    scene = lj.Scene(mechanism, (lj.Torque("load", "planet", torque=torque),), speed=10.0, friction=rubs)
    found = forces(scene, 0.4, 10.0, 0.0)
    inside = z1 / (z2 * share) if drives else share * z1 / z2
    assert found.drive_torque == pytest.approx(-torque * (1 + inside), rel=1e-14)
    rub = found.friction["planet.mesh"]["planet"]
    assert rub.speed == pytest.approx(z1 / z2, rel=1e-14)
    free = abs(torque) * (1 + z1 / z2)
    assert -rub.value * rub.speed == pytest.approx(
        abs(float(found.drive_torque) - math.copysign(free, -torque)), rel=1e-12
    )
    measured = lj.measures.evaluate(scene, ["loss_constant_speed.planet.mesh"])["loss_constant_speed.planet.mesh"]
    assert measured == pytest.approx(-2 * math.pi * float(rub.value * rub.speed), rel=1e-12)  # of a whole turn
    # the couple of the losses acts between planet and arm
    on_planet, on_arm = (found.reactions["planet.mesh"][link].moment for link in ("planet", "arm"))
    assert on_planet == pytest.approx(-torque, rel=1e-14) and float(on_arm) == pytest.approx(
        -float(rub.value), rel=1e-14
    )


def test_successive_approximation():
    """The same forces as by Newton's method; for a guide alone the change of a step is q = f tan β of the one before,
    so that it takes ln(tolerance) / ln(q) steps, and for q > 1 none are enough."""
    scene = crank_slider(force=-200.0)
    scene = dataclasses.replace(scene, friction=everywhere(scene.mechanism, 0.1, 0.01, 0.3))
    at = 4.0, 10 * math.pi, 5.0
    given = jnp.asarray(at[0]), jnp.asarray(at[1]), jnp.asarray(at[2])
    found = successive_approximation(scene, *given)
    assert bool(found.converged)
    assert found.forces.drive_torque == pytest.approx(float(forces(scene, *at).drive_torque), rel=1e-11)
    steps = jax.jit(successive_approximation, static_argnames=("tolerance", "most"))
    for f in (0.3, 1.5, 2.9, 4.0):
        guide = crank_slider(force=-200.0, friction=(GuideFriction("slider", f),), masses=(0.0,) * 3)
        q = f * math.tan(math.asin(math.sin(1.2) / 3))
        count = steps(guide, jnp.asarray(1.2), jnp.asarray(1.0), jnp.asarray(0.0))
        assert bool(count.converged) is (q < 0.87)
        if q < 0.87:
            assert abs(int(count.iterations) - math.log(1e-12) / math.log(q)) <= 3
    with pytest.raises(lj.mechanism.StructureError, match="has none to be approximated"):
        successive_approximation(dataclasses.replace(scene, friction=()), *given)


def test_a_joint_at_rest_has_no_friction():
    """The rods of the geared press keep the pitman parallel to the ram: what moves in their pin is rounding alone."""
    scene = lj.load("geared-press")
    rubs = everywhere(scene.mechanism, 0.1, 0.01)
    every = dataclasses.replace(scene, friction=rubs)
    others = dataclasses.replace(scene, friction=tuple(each for each in rubs if each.joint != "Q"))
    angles = np.radians(np.arange(0.5, 360.0, 3.0))
    at = [jnp.asarray(part) for part in (angles, np.full_like(angles, float(scene.speed)), np.zeros_like(angles))]
    found, without = forces_at(every, *at), forces_at(others, *at)
    assert not np.any(found.friction["Q"]["pitman"].value)
    np.testing.assert_allclose(found.drive_torque, without.drive_torque, rtol=1e-12)


@functools.cache
def with_friction(name: str) -> lj.Scene:
    """A machine with a different friction in every joint."""
    scene = machine(name)
    size = max(float(link.length) for link in scene.mechanism.links.values() if link.length is not None)
    found = []
    for i, each in enumerate(everywhere(scene.mechanism, 0.06, 0.02 * size, mesh=0.9)):
        if isinstance(each, MeshFriction):
            kinds = (dataclasses.replace(each, efficiency=0.99 - 0.03 * (i % 5)),) * 3
        elif isinstance(each, GuideFriction):
            kinds = (GuideFriction(each.link, 0.06 + 0.01 * i, seat=1.2), GuideFriction(each.link, 0.04, groove=0.6),
                     GuideFriction(each.link, 0.05, length=0.3 * size))  # fmt: skip
        else:
            thrust = Thrust(20.0 + i, 0.05 * size, 0.1, 0.02 * size, "run-in" if i % 2 else "unworn")
            kinds = (PinFriction(each.joint, 0.05 + 0.01 * i, 0.02 * size),
                     PinFriction(each.joint, 0.05, 0.03 * size, "unworn", thrust),
                     PinFriction(each.joint, 0.08, 0.01 * size, "run-in"))  # fmt: skip
        found.append(kinds[i % 3])
    return dataclasses.replace(scene, friction=tuple(found))


def states(scene: lj.Scene):
    w = float(scene.speed)
    parts = [(ANGLES, np.full_like(ANGLES, a * w), np.full_like(ANGLES, b * w * w)) for a, b in STATES]
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


@functools.cache
def computed(name: str) -> Forces:
    return jax.device_get(forces_at(with_friction(name), *map(jnp.asarray, states(with_friction(name)))))


@pytest.mark.parametrize("name", MACHINES)
def test_newton_euler(name):
    """Reactions, frictions and drive torque against the equations of all links, repeated until the frictions agree."""
    scene = with_friction(name)
    got, known = computed(name), rubbed.solve(scene, *states(scene))
    assert np.all(got.moves) and known.rounds < rubbed.ROUNDS
    size = max(float(np.max(np.abs(force))) for force, _ in known.solution.reactions.values())
    np.testing.assert_allclose(
        got.drive_torque, known.solution.drive, rtol=0, atol=1e-10 * np.abs(known.solution.drive).max()
    )
    owners = scene.mechanism.owners()
    joints = {(j.name, j.link): j.by or owners[j.point] for group in scene.mechanism.groups for j in group.joints()}
    pairs = {(joint, frozenset((link, joints[joint, link]))): one
             for joint, sides in got.friction.items() for link, one in sides.items()}  # fmt: skip
    assert set(pairs) == set(known.friction)
    for pair, value in known.friction.items():
        one = pairs[pair]
        np.testing.assert_allclose(one.value, value, rtol=0, atol=1e-10 * np.abs(value).max())
        np.testing.assert_allclose(
            one.speed, known.speed[pair], rtol=0, atol=1e-10 * max(1e-3, float(np.max(one.speed)))
        )
    for (joint, link), (force, _) in known.solution.reactions.items():
        if joint.endswith((".guide", ".mesh", ".drive")):
            continue
        there = got.reactions[joint][link]
        np.testing.assert_allclose(there.fx + 1j * there.fy, force, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize("name", MACHINES)
def test_power_balance(name):
    """The drive gives what loads, weight and inertia take, and what every joint loses by its own reaction."""
    scene, got = with_friction(name), computed(name)
    free = jax.device_get(forces_at(dataclasses.replace(scene, friction=()), *map(jnp.asarray, states(scene))))
    losses = np.stack([-one.value * one.speed for joint in got.friction.values() for one in joint.values()])
    assert np.all(losses >= 0)
    largest = np.max(np.abs(got.drive_torque))
    np.testing.assert_allclose(got.drive_torque - free.drive_torque, losses.sum(axis=0), rtol=0, atol=1e-10 * largest)


@pytest.mark.parametrize(
    "name",
    ["scotch-yoke", *(pytest.param(name, marks=pytest.mark.slow) for name in ("hay-press-slider", "moving-guides"))],
)
def test_gradients(name):
    """Drive torque and friction by every number of the machine: forward, reverse, and central differences."""
    scene = with_friction(name)
    leaves, tree = jax.tree.flatten(scene)
    floats = [leaf for leaf in leaves if jnp.issubdtype(jnp.asarray(leaf).dtype, jnp.floating)]
    assert len(floats) == len(leaves)
    base = jnp.concatenate([jnp.ravel(leaf) for leaf in leaves])
    cuts = np.cumsum([leaf.size for leaf in leaves])[:-1]
    made = ready(scene)

    def all_of(x):
        parts = [part.reshape(leaf.shape) for part, leaf in zip(jnp.split(x, cuts), leaves, strict=True)]
        found = kinetostatics(made.of(jax.tree.unflatten(tree, parts)), *map(jnp.asarray, (1.1, 20.0, 40.0)))
        return jnp.stack(
            [found.drive_torque, *(one.value for joint in found.friction.values() for one in joint.values())]
        )

    along = jax.jit(lambda x, way: jax.jvp(all_of, (x,), (way,)))
    weights = jnp.asarray(np.random.default_rng(4).uniform(0.5, 1, along(base, base)[0].shape))
    reverse = jax.jit(jax.grad(lambda x: weights @ all_of(x)))(base)
    forward = np.stack([weights @ along(base, unit)[1] for unit in jnp.eye(base.size)])
    size = np.linalg.norm(reverse * base)
    np.testing.assert_allclose(forward * base, reverse * base, rtol=0, atol=1e-9 * float(size))
    way, h = np.random.default_rng(5).uniform(-1, 1, base.size) * np.abs(base), 1e-5
    (down, falls), (_, slope), (up, rises) = (along(base + k * h * way, way) for k in (-1, 0, 1))
    np.testing.assert_allclose(slope, (up - down) / (2 * h), rtol=0, atol=1e-5 * float(np.abs(slope).max()))
    bends = jax.jit(lambda x, way: jax.jvp(lambda x: jax.jvp(all_of, (x,), (way,))[1], (x,), (way,))[1])(base, way)
    np.testing.assert_allclose(bends, (rises - falls) / (2 * h), rtol=0, atol=1e-5 * float(np.abs(bends).max()))


def test_the_frictionless_limit_is_linear():
    scene = crank_slider(force=-200.0)
    at = 0.7, 10 * math.pi, 5.0
    free = float(forces(scene, *at).drive_torque)

    def more(f):
        return float(
            forces(dataclasses.replace(scene, friction=everywhere(scene.mechanism, f, 0.01)), *at).drive_torque
        )

    assert more(0.0) == pytest.approx(free, rel=1e-14)
    slope = (more(1e-9) - free) / 1e-9
    assert (more(1e-6) - free) / 1e-6 == pytest.approx(slope, rel=1e-5)
    assert slope > 0


@pytest.mark.slow
def test_a_geared_fan_is_analysed():
    """10 N m on a fan that turns four times as fast as the crank, over 100° of it, by teeth that pass on 95 %."""
    links = {"crank": lj.Link(length=0.1, inertia=1.0), "fan": lj.Link(inertia=0.02)}
    groups = [lj.Crank("crank", "A", "B"), lj.Gear("fan", "G", lj.Teeth((20, 80)), "crank", "A")]
    fan = lj.Mechanism({"A": lj.Vec(0.0, 0.0), "G": lj.Vec(-0.15, 0.0)}, links, groups)
    air = lj.Torque("air", "fan", torque=10.0, window=lj.Window(0.0, math.radians(100)))
    scene = lj.Scene(fan, (air,), speed=10.0, friction=(MeshFriction("fan", 0.95),), constant_speed=True)
    works = lj.analyse(scene, angles=12).energies
    assert works is not None
    assert float(works["air"].absorbed) == pytest.approx(40 * math.radians(100), rel=1e-9)
    assert float(works["friction"].absorbed) == pytest.approx(40 * math.radians(100) * (1 / 0.95 - 1), rel=1e-9)
    assert float(works["friction"].supplied) == 0.0


@pytest.mark.parametrize(
    ("friction", "match"),
    [
        ((PinFriction("E", 0.1, 0.01),), "friction.0. .E.: there is no pin 'E'"),
        ((GuideFriction("rod", 0.1),), "there is no guide 'rod.guide'.*slider.guide"),
        (
            (PinFriction("B", 0.1, 0.01), PinFriction("B", 0.2, 0.01)),
            "friction.1. .B.: the joint has a friction already",
        ),
    ],
)
def test_bad_scenes(friction, match):
    with pytest.raises(lj.mechanism.StructureError, match=match):
        crank_slider(friction=friction)


@pytest.mark.parametrize(
    ("made", "match"),
    [
        (lambda: PinFriction("B", -0.1, 0.01), "friction of the journal is -0.1"),
        (
            lambda: PinFriction("B", 0.1, math.nan),
            "radius of the pin 'B' is nan; write a finite number",
        ),
        (lambda: GuideFriction("slider", math.inf), "coefficient of the guide of 'slider' is inf"),
        (lambda: GuideFriction("slider", 0.1, groove=2.0), "half_angle of the groove is 2.0"),
        (lambda: GuideFriction("slider", 0.1, length=0.0), "length of the guide of 'slider' is 0.0"),
        (lambda: Thrust(100.0, 0.02, 0.1, 0.03), "inner of the thrust ring is 0.03; write a radius below"),
    ],
)
def test_bad_numbers(made, match):
    with pytest.raises(ValueError, match=match):
        made()


@pytest.mark.parametrize("coefficient", [3.0, 5.0, 30.0])
def test_where_a_guide_locks(coefficient):
    """The rod pushes the slider against its guide at an angle of at most 19.5°: it locks for a coefficient above √8."""
    scene = crank_slider(force=-200.0, friction=(GuideFriction("slider", coefficient),), masses=(0.0,) * 3)
    assert coefficient > 1 / math.tan(math.asin(abs(math.sin(4.78)) / 3))
    locked, free = forces(scene, 4.78, 1.0, 0.0), forces(scene, 0.02, 1.0, 0.0)
    assert not bool(locked.moves) and locked.drive_torque == math.inf
    assert bool(free.moves) and np.isfinite(free.drive_torque)


def test_redundant_links_are_refused():
    links = {name: lj.Link(length=long) for name, long in (("crank", 0.1), ("rod", 0.3), ("arm", 0.25), ("tie", 0.25))}
    links["rod"] = lj.Link(length=0.3, points={"F": lj.Vec(0.3, 0.0)})
    groups = [lj.Crank("crank", "A", "B"), lj.RRR(("rod", "arm"), "B", "D", "C"), lj.RedundantLink("tie", "D", "F")]
    links["bar"], links["slider"] = lj.Link(length=0.4), lj.Link(mass=1.0)
    groups.append(lj.RRP("bar", "slider", "C", "E", lj.Guide("A", 0.0, -0.1)))
    scene = lj.Scene(lj.Mechanism({"A": lj.Vec(0.0, 0.0), "D": lj.Vec(0.32, 0.0)}, links, groups))
    with pytest.raises(lj.mechanism.StructureError, match="share the reactions of D, which are not unique"):
        dataclasses.replace(scene, friction=(PinFriction("D", 0.1, 0.01), PinFriction("E", 0.1, 0.01)))
    allowed = dataclasses.replace(scene, friction=(PinFriction("A", 0.1, 0.01), GuideFriction("slider", 0.1)))
    assert bool(forces(allowed, 1.0, 1.0, 0.0).moves)


def test_what_is_refused():
    scene = crank_slider(friction=(PinFriction("B", 0.1, 0.01),), force=-100.0)
    with pytest.raises(lj.mechanism.StructureError, match="MuJoCo has no friction that follows"):
        lj.to_mjcf(scene)
    with pytest.raises(lj.mechanism.StructureError, match="constant drive torque and loads without speed"):
        lj.motion.steady_by_diffrax(scene)


def test_a_guide_has_kinks_where_its_edges_begin_to_rub():
    """The larger of two sizes |N| and 2 |M| / L is half the sum of |N - 2 M / L| and |N + 2 M / L|: it is smooth but at
    their zeros, also where N alone is zero."""
    normal, moment = np.random.default_rng(1).normal(size=(2, 200))
    enclosed, flat = GuideFriction("slider", 0.2, length=0.5), GuideFriction("slider", 0.2)
    switches = [enclosed.switches(*at) for at in zip(normal, moment, strict=True)]
    sizes = [
        float(enclosed.size(jnp.asarray(n), jnp.zeros(()), jnp.asarray(m))) for n, m in zip(normal, moment, strict=True)
    ]
    np.testing.assert_allclose(sizes, 0.1 * np.abs(switches).sum(1), rtol=1e-14)
    assert enclosed.kinks == 2 and flat.kinks == len(flat.switches(jnp.ones(()), jnp.zeros(()))) == 1
