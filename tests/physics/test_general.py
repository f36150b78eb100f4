# pyright: reportArgumentType=false, reportAttributeAccessIssue=false
"""Groups closed by Newton's method: the same machines as class II, a drive inside a group, impossible assembly.

The triad of `machines.py` is compared with 50 digits, nested derivatives and Newton-Euler together with all others.
"""

from __future__ import annotations

import dataclasses
import math
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import RRR, Crank, Force, Guide, Harmonic, Link, Mechanism, StructureError, Vec, kinematics
from linkjax._compile import compiled_soon
from linkjax.forces import kinetostatics
from linkjax.groups import Drive, General, ReferencePath, Slot
from linkjax.groups._closure import NEAR
from linkjax.groups._general import LAST
from linkjax.kinematics import margins, pose, prepared
from linkjax.machine import ready
from linkjax.measures import min_margin
from linkjax.motion import steady_motion
from tests.physics.machines import machine
from tests.physics.oracle import assemble, in_axes, open_joints
from tests.physics.twins import all_loosely

ANGLES = np.arange(360) * (2 * math.pi / 360)


@compiled_soon
def everything(scene):
    made = ready(scene)
    return jax.vmap(lambda phi: (pose(made.mechanism, phi), kinetostatics(made, phi, scene.speed, scene.speed**2)))(
        jnp.asarray(ANGLES)
    )


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) for n in ("hay-press", "slotted-levers", "moving-guides")]
)
def test_class_two_by_newtons_method(name):
    """Positions, coefficients and reactions as in closed form, to 1e-12 of the largest of their kind."""
    scene = machine(name)
    twin = scene.with_mechanism(all_loosely(scene.mechanism))
    (one, forces), (two, same) = everything(scene), everything(twin)
    for part in ("r", "dr", "ddr"):
        known = {p: np.stack([getattr(at, part).x, getattr(at, part).y]) for p, at in one.points.items()}
        size = max(np.max(np.abs(value)) for value in known.values())
        for p, value in known.items():
            got = getattr(two.points[p], part)
            np.testing.assert_allclose(np.stack([got.x, got.y]), value, rtol=0, atol=1e-12 * size)
    size = max(float(jnp.max(at.magnitude)) for sides in forces.reactions.values() for at in sides.values())
    for joint, sides in forces.reactions.items():
        for link, at in sides.items():
            got = same.reactions[joint][link]
            for value, truth in ((got.fx, at.fx), (got.fy, at.fy), (got.moment, at.moment)):
                np.testing.assert_allclose(value, truth, rtol=0, atol=1e-12 * size)
    torque = np.max(np.abs(forces.drive_torque))
    np.testing.assert_allclose(same.drive_torque, forces.drive_torque, rtol=0, atol=1e-12 * torque)


@compiled_soon
def followed(made, phi):
    """Points and links, and the initial configuration of Newton's method, of every group of higher class."""
    begun = [path for path in made.paths if isinstance(path, ReferencePath)]
    return jax.vmap(lambda phi: (pose(made, phi), [path.at(phi) for path in begun]))(phi)


def complex_of(at: Vec) -> np.ndarray:
    return np.asarray(at.x) + 1j * np.asarray(at.y)


def general_machines(name: str) -> Mechanism:
    if name.endswith(", loosely"):
        return all_loosely(machine(name.removesuffix(", loosely")).mechanism)
    return machine(name).mechanism


GENERAL = ("triad", "rolling", "elliptic-trammel", "scissor-lift", "hay-press, loosely", "moving-guides, loosely")


@pytest.mark.parametrize("name", ["triad", *(pytest.param(n, marks=pytest.mark.slow) for n in GENERAL[1:])])
def test_five_steps_close_every_joint(name):
    """At 360 equal steps, halfway between the points of the reference path: the five steps leave no closure error, and
    five Newton steps with the equations of the oracle, from the same initial configuration, give the same."""
    assert NEAR + LAST <= 5
    mechanism, angles = general_machines(name), ANGLES + math.pi / 360
    here, begun = jax.device_get(followed(prepared(mechanism), jnp.asarray(angles)))
    points = {p: complex_of(at.r) for p, at in here.points.items()}
    directions = {link: complex_of(state.u) for link, state in here.links.items()}
    size = max(float(link.length) for link in mechanism.links.values())
    every = [g for g in mechanism.groups if isinstance(g, General)]
    assert every
    for g, start in zip(every, begun, strict=True):
        places = in_axes(g, mechanism)
        at = [(points[pins[0]], here.links[link].angle if g.gears else np.angle(directions[link]))
              for link, pins in g.members]  # fmt: skip
        x = np.stack([part for origin, angle in at for part in (origin.real, origin.imag, angle)])

        def left(x, g=g, places=places):
            return np.stack(open_joints(g, places, points, directions, x, phi=angles))

        assert np.max(np.abs(left(x))) <= 1e-13 * size
        angle = start[..., 2] if g.gears else np.arctan2(start[..., 3], start[..., 2])
        x = np.stack([start[..., 0], start[..., 1], angle], -1).reshape((len(angles), -1)).T
        assert np.max(np.abs(left(x))) > 1e-11 * size  # the initial error is not zero
        for _ in range(5):
            slopes = [(left(x + h[:, None]) - left(x - h[:, None])) / 2e-6 for h in 1e-6 * np.eye(len(x))]
            x = x - np.linalg.solve(np.moveaxis(slopes, -1, 0).swapaxes(1, 2), left(x).T[..., None])[..., 0].T
        assert np.max(np.abs(left(x))) <= 1e-13 * size


@pytest.mark.slow
def test_gradients_of_a_cycle():
    """δ when all lengths change together, each by its own fraction, forward and by differences."""
    scene = machine("triad")
    names = list(scene.mechanism.links)
    ways = np.linspace(-1.0, 1.3, len(names))

    def value(by):
        m = scene.mechanism
        links = {n: dataclasses.replace(m.links[n], length=m.links[n].length * (1 + by * w))
                 for n, w in zip(names, ways, strict=True)}  # fmt: skip
        return steady_motion(scene.with_mechanism(Mechanism(m.fixed, links, m.groups, m.flywheel)), 64).delta

    @compiled_soon
    def both(by):
        return jax.vmap(lambda by: jax.jvp(value, (by,), (jnp.ones_like(by),)))(by)

    values, slopes = both(jnp.asarray([0.0, 1e-5, -1e-5]))
    assert float(slopes[0]) == pytest.approx(float((values[1] - values[2]) / 2e-5), rel=1e-7)


@pytest.mark.slow
def test_reverse_mode_agrees():
    scene = machine("triad")
    reverse = jax.jit(jax.grad(lambda m: steady_motion(scene.with_mechanism(m), 64).delta))(scene.mechanism)
    tangent = jax.tree.map(jnp.ones_like, scene.mechanism)
    forward = jax.jvp(lambda m: steady_motion(scene.with_mechanism(m), 64).delta, (scene.mechanism,), (tangent,))[1]
    total = sum(jnp.sum(leaf) for leaf in jax.tree.leaves(reverse))
    assert float(total) == pytest.approx(float(forward), rel=1e-9)


def lift(law) -> lj.Scene:
    """A cylinder from a point of the frame moves a lever that carries a weight."""
    links = {
        "barrel": Link(length=0.3, mass=2.0, inertia=0.02, centre=Vec(0.12, 0.0)),
        "rod": Link(mass=1.0, inertia=0.01, centre=Vec(-0.1, 0.0)),
        "lever": Link(length=0.4, mass=3.0, inertia=0.05, centre=Vec(0.3, 0.0), points={"T": Vec(0.9, 0.0)}),
    }
    group = General(
        (("lever", ("D", "C")), ("barrel", ("A", "H")), ("rod", ("C",))), ("D", "A"),
        {"C": Vec(0.8, 0.1), "H": Vec(0.2, 0.0)}, (Slot("rod", Guide("A", on="barrel")),),
        Drive("rod", "barrel", law=law),
    )  # fmt: skip
    fixed = {"A": Vec(0.0, 0.0), "D": Vec(0.5, -0.1)}
    load = Force("weight", "lever", "T", force=Vec(0.0, -500.0))
    return lj.Scene(Mechanism(fixed, links, [group]), (load,), Vec(0.0, -9.81), 0.5, title="Lift")


@pytest.mark.slow
def test_a_cylinder_between_frame_and_lever():
    """The lever angle by the law of cosines; nearly at rest, the cylinder force by virtual work."""
    scene = dataclasses.replace(lift(Harmonic(0.55, 0.75)), speed=jnp.asarray(1e-6))
    here, forces = everything(scene)
    s, base = 0.65 - 0.1 * np.cos(ANGLES), 0.5 - 0.1j
    pin = np.asarray(here.points["C"].r.x) + 1j * np.asarray(here.points["C"].r.y)
    np.testing.assert_allclose(np.abs(pin), s, rtol=1e-15)
    np.testing.assert_allclose(np.abs(pin - base), 0.4, rtol=1e-15)
    corner = np.arccos((abs(base) ** 2 + 0.16 - s**2) / (2 * abs(base) * 0.4))
    lever = np.angle(-base) - corner
    turn = np.exp(1j * lever)
    np.testing.assert_allclose((pin - base) / 0.4, turn, atol=1e-14)
    drive = forces.reactions["rod.drive"]["rod"]
    push = np.asarray(drive.fx) * (pin / s).real + np.asarray(drive.fy) * (pin / s).imag
    per_stroke = s / (abs(base) * 0.4 * np.sin(corner))  # lever angle over the stroke, which it decreases with
    swing = ((1j * turn * -per_stroke) * (0.9 * 500 + 0.3 * 3 * 9.81)).imag
    beta = np.angle(pin)
    tilt = (np.abs(-per_stroke) * 0.4 * ((1j * turn * -1) / np.exp(1j * beta)).imag) / s
    body = (1j * np.exp(1j * beta) * tilt * 0.12 * 2 * 9.81).imag
    rod = 9.81 * (np.exp(1j * beta) * (1 + 1j * tilt * (s - 0.1))).imag
    np.testing.assert_allclose(push, swing + body + rod, rtol=1e-9)
    assert set(forces.reactions["rod.drive"]) == {"rod", "barrel"}


@pytest.mark.slow
def test_the_whole_story_of_a_cylinder():
    scene = lift(Harmonic(0.55, 0.75))
    cycle = lj.analyse(scene, angles=72)
    assert max(float(check) for check in jax.tree.leaves(cycle.checks)) < 1e-10
    power = cycle.forces.drive_torque * scene.speed
    assert float(jnp.mean(power)) == pytest.approx(0.0, abs=1e-9 * float(jnp.max(jnp.abs(power))))


@pytest.mark.slow
def test_where_it_cannot_be_assembled():
    """The cylinder is longer than the lever permits: the stroke is named, and the gradient leads back."""
    scene = lift(Harmonic(0.55, 0.95))
    with pytest.raises(
        lj.MachineError, match=r"'lever-barrel-rod' cannot be assembled at 1[0-9.]+ degrees .* \(loops\)"
    ):
        lj.analyse(scene, angles=8)
    value, slope = compiled_soon(jax.value_and_grad(lambda m: min_margin(scene.with_mechanism(m))))(scene.mechanism)
    assert float(value) < 0
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(slope))
    assert float(slope.groups[0].drive.law.stop) < 0 < float(slope.links["lever"].length)


def singular_values(mechanism: Mechanism, angles) -> np.ndarray:
    """Least singular values of the closure's Jacobian of the first group, by differences of the oracle's equations."""
    group = mechanism.groups[1]
    places, found = in_axes(group, mechanism), []
    size = max(abs(at) for link, pins in group.members for p, at in places[link].items() if p in pins)
    scale = np.tile([1.0, 1.0, 1.0 / size], len(group.members))  # angles times the size
    for phi in angles:
        points, directions = assemble(mechanism, phi)
        x = np.ravel([[points[pins[0]].real, points[pins[0]].imag, np.angle(directions[link])]
                      for link, pins in group.members])  # fmt: skip
        outside = {p: points[p] for p in group.outer}

        def left(x, outside=outside, directions=directions):
            return np.asarray(open_joints(group, places, outside, directions, x), float)

        columns = [(left(x + h) - left(x - h)) / 2e-6 for h in np.diag(1e-6 * scale)]
        found.append(np.linalg.svd(np.stack(columns, axis=1), compute_uv=False)[-1])
    return np.asarray(found)


def test_the_margin_is_the_least_singular_value():
    """With its rates, against differences of independently written equations."""
    mechanism = machine("triad").mechanism
    angles, h = np.asarray([0.4, 1.7, 3.1, 5.2]), 0.02
    every = np.concatenate([angles + k * h for k in (0, 1, -1, 2, -2)])
    found = compiled_soon(lambda m: jax.vmap(lambda phi: margins(m, phi)["plate-bar1-bar2-bar3"]["loops"])(
        jnp.asarray(angles)))(prepared(mechanism))  # fmt: skip
    here, one, less, two, least = singular_values(mechanism, every).reshape((5, -1))  # differences of fourth order
    np.testing.assert_allclose(found.value, here, rtol=1e-8)
    np.testing.assert_allclose(found.d, (8 * (one - less) - two + least) / (12 * h), atol=1e-6)
    np.testing.assert_allclose(found.dd, (16 * (one + less) - two - least - 30 * here) / (12 * h**2), atol=1e-5)


def four_bar(crank=0.1, coupler=0.3, rocker=0.25, far=0.4, phase=0.0, law=None) -> Mechanism:
    """A four-bar whose dyad is a group of higher class."""
    links = {"crank": Link(length=crank), "coupler": Link(length=coupler), "rocker": Link(length=rocker)}
    group = General((("coupler", ("B", "C")), ("rocker", ("D", "C"))), ("B", "D"), {"C": Vec(0.3, 0.2)})
    return Mechanism(
        {"A": Vec(0.0, 0.0), "D": Vec(far, 0.0)}, links, [Crank("crank", "A", "B", "ccw", phase, law), group]
    )


@pytest.fixture(scope="module")
def least():
    """Least margin of a four-bar, and its slope over the coupler length, by one program."""
    return jax.jit(jax.value_and_grad(lambda coupler, m: kinematics.min_margin(
        dataclasses.replace(m, links={**m.links, "coupler": Link(length=coupler)}))))  # fmt: skip


@pytest.mark.slow
def test_the_least_margin(least):
    """It does not depend on the start of the scan, and its slope is that of differences."""
    one, two = (least(0.3, four_bar(phase=phase)) for phase in (0.0, 0.37))
    np.testing.assert_allclose(one, two, rtol=1e-9)
    step = 1e-6
    slope = (least(0.3 + step, four_bar())[0] - least(0.3 - step, four_bar())[0]) / (2 * step)
    assert float(one[1]) == pytest.approx(float(slope), rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("phase", [0.0, 0.37, 1.0])
def test_a_parallelogram_has_a_change_point(least, phase):
    value, _ = least(0.3, four_bar(rocker=0.1, far=0.3, phase=phase))
    assert -2e-6 < float(value) <= 0


@pytest.mark.slow
def test_close_to_a_dead_position(least):
    """A linkage that closes by 1e-5 is assembled, one that is 1e-5 too short is not."""
    for phase in (0.03, 0.37):
        assert float(least(0.3, four_bar(far=0.45 - 1e-5, phase=phase))[0]) > 0
        assert float(least(0.3, four_bar(far=0.45 + 1e-4, phase=phase))[0]) < 0


@pytest.mark.slow
def test_a_fast_law_is_followed(least):
    """A law that turns the crank by six degrees per path step."""
    law = lj.Spline((0.0, 1.5, 3.0, 4.5), [-0.0195, -0.9717, 1.5215, 0.0266])
    mechanism = four_bar(0.2976, 0.3089, 0.2916, 0.3165, law=law)
    every = compiled_soon(lambda m, phi: jax.vmap(lambda phi: margins(m, phi)["coupler-rocker"]["loops"].value)(phi))
    angles, step = np.linspace(0.0, 2 * math.pi, 3601), 2 * math.pi / 3600
    values = np.asarray(every(prepared(mechanism), jnp.asarray(angles)))
    closely = angles[values.argmin()] + np.linspace(-step, step, 3601)
    values = np.asarray(every(prepared(mechanism), jnp.asarray(closely)))
    assert float(least(0.3089, mechanism)[0]) == pytest.approx(values.min(), rel=1e-8) and values.min() > 0


@pytest.mark.slow
def test_a_law_of_two_turns():
    """Poses, margins and forces of the second turn, as in closed form."""
    law = lj.Spline((0.0, 3.0, 6.0, 9.0), [0.9621, 0.376, -1.3615, 0.8157], 4 * math.pi)
    m = four_bar(0.2577, 0.4968, 0.4695, 0.1608, law=law)
    plain = dataclasses.replace(m, groups=(m.groups[0], RRR(("coupler", "rocker"), "B", "D", "C")))
    load = (Force("F", "rocker", "C", force=Vec(0.0, -50.0)),)
    for phi in (2.0, 6.6, 11.0):
        one, two = (lj.Scene(each, load, speed=1.0, cycle_turns=2) for each in (m, plain))
        torques = [
            kinetostatics(s, jnp.asarray(phi), jnp.asarray(1.0), jnp.asarray(0.0)).drive_torque for s in (one, two)
        ]
        assert float(torques[0]) == pytest.approx(float(torques[1]), rel=1e-10)
        c = [pose(each, jnp.asarray(phi)).points["C"].r for each in (m, plain)]
        np.testing.assert_allclose([c[0].x, c[0].y], [c[1].x, c[1].y], atol=1e-14)


@pytest.mark.slow
def test_single_precision(least):
    """Without enable_x64 a valid machine is accepted."""
    exact = float(least(0.3, four_bar())[0])
    with jax.enable_x64(False), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        links = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), four_bar())
        assert float(jax.jit(kinematics.min_margin)(links)) == pytest.approx(exact, rel=1e-5)


def test_a_path_belongs_to_its_numbers():
    made = prepared(four_bar())
    assert isinstance(made.paths[1], ReferencePath)
    again = dataclasses.replace(made.mechanism, fixed={**made.mechanism.fixed, "D": Vec(0.35, 0.0)})
    path = prepared(again).paths[1]
    assert isinstance(path, ReferencePath) and bool(jnp.any(path.z != made.paths[1].z))


@pytest.mark.parametrize(
    ("members", "outer", "says"),
    [
        (
            (("one", ("B", "C")), ("two", ("D", "C"))),
            ("B",),
            "2 links have 6 degrees of freedom, but their joints remove 4",
        ),
        ((("one", ("B", "C")),), ("B", "C"), "1 links have 3 degrees of freedom, but their joints remove 4"),
    ],
)
def test_what_is_no_group(members, outer, says):
    with pytest.raises(ValueError, match=says):
        General(members, outer, {})


def test_a_sketch_of_many_designs():
    """Points that coincide in the sketch are found in any of them."""
    links = {"crank": Link(length=0.1), "plate": Link(length=0.25, points={"G": Vec(0.1, 0.2)})}
    links |= {"bar": Link(length=0.3), "arm": Link(length=0.3), "block": Link()}
    members = (("plate", ("E", "F", "G")), ("bar", ("B", "E")), ("arm", ("D", "F")), ("block", ("G",)))

    def made(far: list[float]) -> Mechanism:
        sketch = {"E": Vec(jnp.asarray([0.1, 0.1]), 0.2), "F": Vec(jnp.asarray(far), 0.2), "G": Vec(0.2, 0.4)}
        group = General(members, ("B", "D"), sketch, (Slot("block", Guide("D", 1.0)),))
        return Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.5, 0.0)}, links, [Crank("crank", "A", "B"), group])

    assert made([0.3, 0.4]).driving_link == "crank"
    with pytest.raises(StructureError, match="'E' and 'F' of link 'plate' coincide in the sketch"):
        made([0.3, 0.1])


def test_what_a_drive_cannot_do():
    members = (("lever", ("D", "C")), ("barrel", ("A", "H")), ("rod", ("C",)))
    slot = Slot("rod", Guide("A", on="barrel"))
    with pytest.raises(ValueError, match="along a guide, which requires a motion law; set `law`"):
        General(members, ("D", "A"), {}, (slot,), Drive("rod", "barrel"))
    with pytest.raises(ValueError, match="moves 'ram' relative to 'barrel'; name links of the group"):
        General(members, ("D", "A"), {}, (slot,), Drive("ram", "barrel"))


def test_names_are_checked():
    group = General((("coupler", ("B", "C")), ("rocker", ("D", "C"))), ("B", "D"), {"C": Vec(0.3, 0.2)})
    links = {"crank": Link(length=0.1), "coupler": Link(length=0.3), "rocker": Link(length=0.25)}
    with pytest.raises(StructureError, match="point 'D' is not defined"):
        Mechanism({"A": Vec(0.0, 0.0)}, links, [Crank("crank", "A", "B"), group])


@pytest.mark.parametrize(
    ("plate", "sketch", "through", "says"),
    [
        (("E", "F", "H"), {"E": Vec(0.15, 0.28), "F": Vec(0.4, 0.25)}, "E", "link 'plate' has no coupler point 'H'"),
        (("E", "F", "G"), {"E": Vec(0.15, 0.28)}, "E", "does not locate link 'plate'; sketch two of its points"),
        (("E", "F", "G"), {"E": Vec(0.15, 0.28), "F": Vec(0.4, 0.25)}, "D", "on link 'plate', but point 'D' is not"),
    ],
)
def test_what_is_missing_is_told(plate, sketch, through, says):
    links = {"crank": Link(length=0.1), "plate": Link(length=0.25, points={"G": Vec(0.1, 0.2)})}
    links |= {"bar": Link(length=0.3), "arm": Link(length=0.3), "block": Link()}
    members = (("plate", plate), ("bar", ("B", "E")), ("arm", ("D", "F")), ("block", (plate[2],)))
    group = General(members, ("B", "D"), sketch, (Slot("block", Guide("D", 1.0)),))
    if through == "D":
        group = dataclasses.replace(group, slots=(Slot("block", Guide("D", 1.0, on="plate")),))
    with pytest.raises(StructureError, match=says):
        Mechanism({"A": Vec(0.0, 0.0), "D": Vec(0.5, 0.0)}, links, [Crank("crank", "A", "B"), group])
