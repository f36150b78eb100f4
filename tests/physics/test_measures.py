"""Every measure on every scene: finite, differentiable both ways, against differences, same for all nodes and units."""

from __future__ import annotations

import dataclasses
import functools
import gc
import itertools

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import linkjax as lj
from linkjax import measures
from linkjax._compile import CompiledSoon, compiled_soon
from linkjax.analysis import measured
from linkjax.kinematics import min_margin
from linkjax.measures import MEASURES
from linkjax.motion import every_row, steady_by_diffrax
from tests.physics.machines import machine, resized

FEW, MANY = 96, 160
# nodes where 96 leave an error that counts
STEEP = {"oscillating-cylinder": 144, "hay-press": 128, "elliptic-trammel": 144}
EVERY = lj.scene_names()
SCENES = [pytest.param(name, marks=[pytest.mark.slow]) for name in EVERY]
EVEN = ("slider-crank", "four-bar")  # no two values are equal
HELD = ("andrews-squeezer", "combine-shoe", "scissor-lift")  # their loops close with these numbers only
CHANGED = {  # the larger of two equal values has no slope
    "slider-crank": {"groups[1].guide.along": "1 deg"},  # otherwise the piston has one height
    "elliptic-trammel": {"gravity": ["0.2 m/s^2", "-0.5 m/s^2"]},  # otherwise it is the same in both senses
    "oscillating-cylinder": {"groups[1].offset": "5 mm"},  # or its transmission angle is a right angle throughout
    "two-cylinder": {  # otherwise its pairs are nearly equal; and a peak is not smooth where two loads switch together
        "groups[1].guide.offset": "25 mm",
        "loads[0].force": [0, "-2600 N"],
        "loads[0].window": ["272 deg", "93 deg"],
        "loads[1].window": ["87 deg", "264 deg"],
        "loads[2].window": ["98 deg", "281 deg"],
        "loads[3].window": ["277 deg", "84 deg"],
    },
    "scissor-lift": {  # otherwise both bars carry the same load, and points lie on an axis throughout
        "loads[0].force": [0, "-3000 N"],
        "links.bar.centre": "700 mm",
        "links.barrel.centre": "200 mm",
        "links.brace.points.U": "2900 mm",
    },
    "geared-press": {  # otherwise its halves are nearly mirror images
        "links.right.length": "450 mm",
        "links.wheel.length": "50 mm",
        "groups[1].phase": "165 deg",
        "links.crank.centre": "20 mm",
        "loads[0].window": ["265 deg", "305 deg"],  # or forces at the dead centre and at its end are nearly equal
    },
    "combine-shoe": {"links.crank.centre": "20 mm"},  # a place on the axis has no slope
    # otherwise statics gives two joints of the crank the same force
    "friction-slider-crank": {"gravity": ["0.2 m/s^2", "-0.5 m/s^2"]},
    "spring-door": {  # otherwise it is as fast at the beginning as at the end of its ways
        f"groups[0].law.moves[{i}].over": f"{angle} deg"
        for i, angle in enumerate((9.6, 114.2, 10.3, 45.9, 11, 112.8, 12, 44.2))
    },
    # otherwise the locking factor is least where the load begins at zero, and has no value there
    "toggle-clamp": {"loads[0].values[0]": "-5 N"},
    "pump-with-motor": {"loads[0].window": ["187 deg", "352 deg"]},  # otherwise it begins where the piston turns back
    "two-slider-press": {"groups[1].guide.offset": "3 mm", "links.crank.centre": "20 mm"},
}
H = 3e-4  # step of the differences
FINER = {
    "scissor-lift": 3e-5,
    "geared-press": 1.5e-4,
    "hay-press": 5e-5,
    "two-slider-press": 5e-5,
    "press-with-motor": 1e-4,
    "press-with-friction": 3e-5,  # the friction of a pin varies steeply where the load begins
}  # forces are steep, or almost vanish
LOST = 2e-14  # rounding of a least force, for every square of its depth
AWAY = 1e-8  # of a half panel: how far three points beside a summit leave it
ROUNDED = 1e-10  # of a half panel: what rounding of values 1.25e-5 apart leaves of its place
ZERO = {"Andrews' squeezer": 3e-5}  # the scale of a change of a zero; this machine weighs grams
FLAT = {  # measures of `MEASURES` without slope
    "andrews-squeezer": ("mean_drive_torque", "mean_drive_power", "energy_per_cycle"),  # without loads
    "scissor-lift": (  # a motion law prescribes the crank speed, weights and inertia are negligible beside the load
        "delta", "slow_down", "energy_per_cycle", "steady_state_margin", "min_inertia_ratio", "mean_drive_torque",
        "mean_drive_power",
        "flywheel_for_target_delta", "peak_shaking_force", "peak_shaking_force_constant_speed",
        "rms_shaking_force_constant_speed", "peak_shaking_moment_constant_speed", "min_transmission_angle",
    ),
    # likewise a motion law
    "toggle-clamp": ("delta", "slow_down", "steady_state_margin", "min_inertia_ratio", "flywheel_for_target_delta"),
    "spring-door": (  # likewise, and its spring and weight are conservative
        "delta", "slow_down", "energy_per_cycle", "steady_state_margin", "min_inertia_ratio", "mean_drive_torque",
        "mean_drive_power", "flywheel_for_target_delta",
    ),
}  # fmt: skip
KINK = 1e-4  # of the slope: a smooth function bends four times as much over twice the step, by far less
MOST = 16  # measures of one program: a large one takes several times as long to compile as its parts, and its memory
SOME = 3  # elements of one kind, spread over a large machine
ONE = ("kozhevnikov-press", "press-with-friction", "toggle-clamp")  # of these, one: their programs take minutes each
PARTS = {"press-with-friction": 6}  # of the sweep of gradients, which takes hours and much memory at once
FLOOR = 1e-9  # of the largest measure of the same unit: a slope below it is that of a measure that is constant


def machine_of(name: str) -> str:
    """The scene of a sweep."""
    return name.partition(",")[0]


@functools.cache
def swept(name: str) -> lj.Scene:
    """A built-in scene, changed slightly where its measures are not smooth."""
    name = machine_of(name)
    scene = lj.load(name, CHANGED.get(name, {}))
    if name in (*EVEN, *HELD):
        return scene
    leaves, tree = jax.tree.flatten(scene.mechanism)
    off, zero = 0.01 * np.random.default_rng(3).uniform(-1, 1, len(leaves)), ZERO.get(scene.title, 0.03)

    def moved(sense: int) -> lj.Mechanism:
        """A length or mass that is zero becomes positive, but not the flywheel of a machine without a crankshaft."""
        pairs = zip(leaves, sense * off, strict=True)
        made = jax.tree.unflatten(tree, [leaf + jnp.where(leaf == 0, zero * abs(x), leaf * x) for leaf, x in pairs])
        return made if made.driver.shaft() is not None else dataclasses.replace(made, flywheel=lj.mechanism.Flywheel())

    # away from singular positions, where 96 nodes are too few
    return scene.with_mechanism(max((moved(1), moved(-1)), key=lambda each: float(min_margin(each))))


FEWER = "slider-crank, one of each family"  # the quickest sweep


def names_of(name: str) -> tuple[str, ...]:
    """Every measure of a scene, or a part of them, which has all of an element that are of one motion; or the first of
    each family at constant speed and of the others."""
    if name != FEWER:
        scene, _, part = name.partition(", part ")
        names = all_names(scene)
        if not part:
            return names
        groups: dict[tuple, list[str]] = {}
        for each in names:
            groups.setdefault((measures.named(each).motion, each.partition(".")[2]), []).append(each)
        before = np.cumsum([0, *map(len, groups.values())])[:-1]
        of = before * PARTS[scene] // len(names)
        return tuple(
            itertools.chain.from_iterable(g for g, i in zip(groups.values(), of, strict=True) if i == int(part))
        )
    names = all_names("slider-crank")
    first = {each.partition(".")[0]: each for each in reversed(names)}
    return tuple(
        each for each in names if each in first.values() and (each in MEASURES or measures.named(each).motion is False)
    )


def of_some(names: tuple[str, ...], some: int = SOME) -> list[str]:
    """The measures of the whole machine, and those of some elements of each kind, spread over the machine. Elements are
    of one kind if they have the same measures."""
    of: dict[str, list[str]] = {}
    for each in names:
        of.setdefault(each.partition(".")[2], []).append(each)
    kinds: dict[tuple[str, ...], list[str]] = {}
    for element, own in of.items():
        kinds.setdefault(tuple(each.partition(".")[0] for each in own), []).append(element)
    picked = {
        alike[i] for alike in kinds.values() for i in np.linspace(0, len(alike) - 1, min(some, len(alike))).astype(int)
    }
    return [each for each in names if each.partition(".")[2] in picked]


@functools.cache
def all_names(name: str) -> tuple[str, ...]:
    """Every measure of a scene, of some elements of each kind; of links that never turn back the time ratio is
    infinite, and without loads the ratio of inertia forces to others."""
    none = ("min_transmission_angle",) if measures.no_transmission_angle(machine(name).mechanism) else ()
    some = 1 if name in ONE else SOME
    known = [each for each in of_some(measures.measure_names(swept(name)), some) if each not in none]
    found = measures.evaluate(swept(name), known)
    ratios = ("time_ratio", "inertia_force_ratio")
    exist = [each for each, value in found.items() if not (each.startswith(ratios) and np.isinf(value))]
    return tuple(sorted(exist, key=lambda each: measures.named(each).motion))  # few parts contain the actual motion


def every(scene: lj.Scene, names: tuple[str, ...], nodes: int) -> jax.Array:
    """The measures named."""
    found = measures.evaluate(scene, names, nodes)
    return jnp.stack([found[name] for name in names])


@compiled_soon(static=("names", "nodes"))
def values(scene: lj.Scene, names: tuple[str, ...], nodes: int) -> jax.Array:
    return every(scene, names, nodes)


@compiled_soon(static=("names",))
def forward(scene: lj.Scene, direction: lj.Scene, names: tuple[str, ...]) -> tuple[jax.Array, jax.Array]:
    """The measures named, and their derivatives along a direction."""
    return jax.jvp(lambda scene: every(scene, names, MANY), (scene,), (direction,))


@compiled_soon(static=("names",))
def backward(scene: lj.Scene, weights: jax.Array, names: tuple[str, ...]) -> lj.Scene:
    """Gradient of the weighted sum of measures. With respect to the scene itself and one at a time: a program with
    pullbacks in a loop compiles ten times longer for a machine of many groups."""
    return jax.grad(lambda scene: weights @ every(scene, names, MANY))(scene)


def parts(name: str) -> list[tuple[str, ...]]:
    """The measures of a scene, some at a time."""
    names = names_of(name)
    return [names[i : i + MOST] for i in range(0, len(names), MOST)]


def of_parts(program: CompiledSoon, name: str, *args, **fixed) -> list:
    """The results of a program for all measures, part by part, compiled at the same time."""
    for names in parts(name):
        program.ahead(*args, names=names, **fixed)
    return [program(*args, names=names, **fixed) for names in parts(name)]


def dropped(program: CompiledSoon) -> None:
    """Drop the programs of a function: all derivatives of a large machine together would fill the memory."""
    program.programs.clear()
    gc.collect()


@functools.cache
def gradients(name: str) -> np.ndarray:
    """Gradients of measures with respect to relative changes of every number, `ZERO` where it is zero:
    (measures, numbers)."""
    scene = swept(name)
    leaves = np.asarray(jax.tree.leaves(scene))
    size = np.where(leaves == 0, ZERO.get(scene.title, 0.03), leaves)
    rows = []
    for names in parts(name):
        rows += [jax.tree.leaves(backward(scene, weights, names=names)) for weights in jnp.eye(len(names))]
        dropped(backward)
    return np.asarray(rows) * size


def valued(name: str, scene: lj.Scene) -> np.ndarray:
    """The measures of a sweep, of its own scene or of one of the same structure."""
    found = np.concatenate(of_parts(values, name, scene, nodes=STEEP.get(machine_of(name), FEW)))
    if name in IN_PARTS:
        dropped(values)
    return found


@functools.cache
def all_values(name: str) -> np.ndarray:
    return valued(name, swept(name))


@functools.cache
def neighbours(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Measures with every number two steps down, one down, one up and two up, and (last row) unchanged; and their
    derivatives with respect to every number, forward: (numbers, measures)."""
    scene, h = swept(name), FINER.get(machine_of(name), H)
    leaves, tree = jax.tree.flatten(scene)
    leaves = np.asarray(leaves)
    size, none = np.where(leaves == 0, ZERO.get(scene.title, 0.03), leaves), np.zeros(leaves.size)
    steps = [k * h * unit for k in (-2, -1, 1, 2) for unit in np.eye(leaves.size)] + [none]
    pairs = [(step, none) for step in steps] + [(none, unit) for unit in np.eye(leaves.size)]

    def tree_of(numbers: np.ndarray) -> lj.Scene:
        return jax.tree.unflatten(tree, list(map(np.asarray, numbers)))

    found = []
    for names in parts(name):
        found.append(
            [forward(tree_of(leaves + size * step), tree_of(size * along), names=names) for step, along in pairs]
        )
        dropped(forward)
    values, slopes = (np.concatenate([[each[i] for each in part] for part in found], axis=1) for i in range(2))
    return values[: len(steps)], slopes[len(steps) :]


def floors(name: str) -> np.ndarray:
    """For every measure, the slope below which it is constant up to rounding; that of work is that of torques."""
    names, found = names_of(name), np.abs(all_values(name))
    units = np.asarray([measures.named(each).unit.replace("J", "N m") for each in names])
    return FLOOR * np.asarray([np.max(found[units == unit]) for unit in units])


def zeros(name: str) -> np.ndarray:
    """For every measure, what counts as zero beside the others."""
    flat, names = FLAT.get(machine_of(name), ()), names_of(name)
    own = [1e-10 if each in flat else 1e-12 for each in names]
    families = np.asarray([each not in MEASURES for each in names])
    return np.where(families, 1e-3 * floors(name), own)


def depths(name: str) -> np.ndarray:
    """For the smallest length of a vector, the greatest length divided by it; one for all other measures. The slope of
    a force that almost vanishes is that of its square, which depends on the place by so much more."""
    found = dict(zip(names_of(name), np.abs(all_values(name)), strict=True))
    pairs = [(each, each.replace("min_reaction", "peak_reaction", 1)) for each in found]
    return np.asarray([found[peak] / found[each] if peak in found and found[each] else 1.0 for each, peak in pairs])


EXTREMES = ("min_", "max_", "peak_")


def ties(name: str) -> np.ndarray:
    """Which measures are extremes, or the extent, of what is constant over the cycle: the height of a point on a level
    guide, a force that only a constant load causes."""
    found = dict(zip(names_of(name), zip(all_values(name), floors(name), strict=True), strict=True))
    held = {
        each.removeprefix("min_")
        for each, (least, floor) in found.items()
        if each.startswith("min_") and abs(found.get(each.replace("min", "max", 1), (np.inf,))[0] - least) <= floor
    }
    held |= {each.replace("angle.", "swing.", 1) for each in held if each.startswith("angle.")}
    return np.asarray([each in held or (each.startswith(EXTREMES) and each.split("_", 1)[1] in held) for each in found])


IN_PARTS = [f"{name}, part {i}" for name in EVERY if name in PARTS for i in range(PARTS[name])]
SWEEPS = [FEWER, *(name for name in EVERY if name not in PARTS), *IN_PARTS]


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) for name in SWEEPS])
def test_gradients(name):
    """Every measure of a scene: finite, and the same forward, in reverse and by fourth-order differences, for every
    number. One Jacobian each way. Where two values are equal the larger one has a kink, as have extremes of what is
    constant."""
    names, reverse, (f, ahead), h = names_of(name), gradients(name), neighbours(name), FINER.get(machine_of(name), H)
    assert np.all(np.isfinite(reverse))
    rounding, deep = 1e-5 * floors(name), depths(name)
    turn = np.asarray([2 * np.pi if measures.named(each).unit == "J" else 1.0 for each in names])  # work of a torque
    lost = 2 * np.finfo(float).eps / h * turn * floors(name) / FLOOR  # rounding of differences, of the unit's largest
    size = np.linalg.norm(reverse, axis=1) + floors(name)
    count = reverse.shape[1]
    middle, f = f[-1], f[:-1].reshape((4, count, len(names)))
    differences = ((f[0] - f[3]) + 8 * (f[2] - f[1])).T / (12 * h)
    near, far = f[1] + f[2] - 2 * middle[None], f[0] + f[3] - 2 * middle[None]
    flat = np.asarray([each in FLAT.get(machine_of(name), ()) for each in names])
    kinks = ~flat & (np.max(np.abs(far - 4 * near), axis=0) / h > KINK * size)
    seldom = kinks & ~ties(name)
    assert np.mean(seldom) <= 0.02, [each for each, kink in zip(names, seldom, strict=True) if kink]
    wrong = {}
    for i, each in enumerate(names):
        both, away = (np.max(np.abs(part - reverse[i])) for part in (ahead.T[i], differences[i]))
        if flat[i]:  # rounding, beside torques of kilonewton metres
            good = np.max(np.abs([reverse[i], ahead.T[i]])) < 1e-10
            good &= np.max(np.abs(differences[i])) < 1e-7 + lost[i]
        else:
            norm = np.linalg.norm(reverse[i])
            good = both <= max(1e-9, LOST * deep[i] ** 2, ROUNDED * deep[i]) * size[i] + rounding[i]
            good &= each not in MEASURES or (norm > 0 and both <= 1e-10 * norm)
            good &= bool(kinks[i]) or away <= max(1e-6, AWAY * deep[i]) * size[i] + lost[i]
        if not good:
            wrong[each] = both / size[i], away / size[i], deep[i]
    assert not wrong, "\n".join(
        f"{each}: {both:.1e} {away:.1e} {deep:.1e}" for each, (both, away, deep) in wrong.items()
    )
    moved = np.linalg.norm(reverse, axis=1) > floors(name)
    assert np.mean(moved) > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_independent_of_the_number_of_nodes(name):
    many, few = neighbours(name)[0][-1], all_values(name)
    least = np.where([each in MEASURES for each in names_of(name)], 1e-8, floors(name))
    away = np.abs(few - many)
    wrong = away > 1e-8 * np.abs(many) + least
    assert not np.any(wrong), "\n".join(
        f"{each}: {a} {b}" for each, a, b, bad in zip(names_of(name), few, many, wrong, strict=True) if bad
    )


POWERS = {
    "1": (0, 0, 0),
    "m": (1, 0, 0),
    "m/s": (1, 0, -1),
    "m/s^2": (1, 0, -2),
    "s": (0, 0, 1),
    "rad": (0, 0, 0),
    "rad/s": (0, 0, -1),
    "rad/s^2": (0, 0, -2),
    "N": (1, 1, -2),
    "N m": (2, 1, -2),
    "W": (2, 1, -3),
    "J": (2, 1, -2),
    "kg m^2": (2, 1, 0),
}


@pytest.mark.slow
@pytest.mark.parametrize("units", [(1e3, 1e-3, 1.0), (1e-6, 1e-18, 1e-2), (1e6, 1e9, 1e3)])
@pytest.mark.parametrize("name", [FEWER, *SCENES])
def test_unchanged_by_units(name, units):
    """Millimetres and tonnes, very small and very large machines: the same numbers in their own units."""
    before, names = all_values(name), names_of(name)
    after = valued(name, resized(swept(name), *units))
    back = [np.prod([u**-p for u, p in zip(units, POWERS[measures.named(n).unit], strict=True)]) for n in names]
    assert np.all(np.abs(after * back - before) <= 1e-9 * np.abs(before) + zeros(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_an_analysis_holds_the_same_numbers(name):
    """The values that `measured` reads from a cycle, from other programs; only some scenes have a target for δ."""
    found = measured(lj.analyse(swept(name), angles=4, nodes=STEEP.get(machine_of(name), FEW)))
    expected = dict(zip(names_of(name), all_values(name), strict=True))
    least = dict(zip(names_of(name), zeros(name), strict=True))
    assert set(MEASURES) - set(found) <= {"flywheel_for_target_delta", "min_transmission_angle"}
    for measure, value in found.items():
        assert value == pytest.approx(expected[measure], rel=1e-9, abs=least[measure]), measure


def test_a_peak_where_a_load_begins_at_crank_angle_zero():
    """The greatest speed of the crank pin is where the tool begins to cut, at crank angle zero, where a panel ends for
    the angle of a link as well: together with it, and by itself, the speed has the derivative of differences."""
    scene = lj.load("quick-return")

    def moved(on: jax.Array) -> lj.Scene:
        (load,) = scene.loads
        assert isinstance(load, lj.OpposingForce)
        return dataclasses.replace(scene, loads=(dataclasses.replace(load, window=lj.Window(on, jnp.asarray(3.0))),))

    @compiled_soon
    def both(on: jax.Array) -> tuple[jax.Array, jax.Array]:
        names = ["max_velocity.B", "max_angle.die"]
        return jax.jvp(lambda on: measures.evaluate(moved(on), names, 64)["max_velocity.B"], (on,), (jnp.ones(()),))

    h = 1e-4
    below, above = (float(both(jnp.asarray(step))[0]) for step in (-h, h))
    assert float(both(jnp.asarray(0.0))[1]) == pytest.approx((above - below) / (2 * h), rel=1e-6)


def test_windows_that_switch_together_do_not_shake():
    """At constant speed no load shakes the frame: its window has no slope, even in a panel of zero width."""
    scene = machine("slider-crank")
    both = lj.Window(jnp.asarray(0.7), jnp.asarray(4.0))
    loads = tuple(lj.Torque(name, "crank", torque=-size, window=both) for name, size in (("one", 3.0), ("two", 5.0)))
    scene = dataclasses.replace(scene, loads=loads)
    slope = compiled_soon(jax.grad(lambda scene: measures.rms_shaking_force_constant_speed(scene, 48)))(scene)
    assert float(slope.speed) > 0
    assert [float(leaf) for leaf in jax.tree.leaves(slope.loads)] == [0.0] * 6


def switched_together() -> lj.Scene:
    """A machine of which four loads begin and end at two angles, one at one of them only."""
    times = {"one": (0.7, 4.0, -3.0), "two": (0.7, 4.0, 5.0), "three": (4.0, 0.7, 2.0), "four": (0.7, 5.0, -4.0)}
    scene = machine("slider-crank")
    windows = {name: lj.Window(jnp.asarray(on), jnp.asarray(off)) for name, (on, off, _) in times.items()}
    loads = tuple(lj.Torque(n, "crank", torque=size, window=windows[n]) for n, (_, _, size) in times.items())
    return dataclasses.replace(scene, loads=scene.loads + loads)


@functools.cache
def by_single_ends(measure) -> np.ndarray:
    """Derivatives with respect to each end of each window of `switched_together`, (loads, ends)."""
    slope = compiled_soon(jax.grad(measure))(switched_together())
    return np.asarray([[load.window.on, load.window.off] for load in slope.loads[1:]])


def mean_torque(scene: lj.Scene) -> jax.Array:
    return measures.mean_drive_torque(scene, MANY)


def swing(scene: lj.Scene) -> jax.Array:
    return measures.delta(scene, MANY)


def test_windows_that_switch_together_count_each_for_itself():
    """The drive compensates a load at its beginning and end, whatever else switches there (closed form)."""
    scene = switched_together()
    torque = np.asarray([float(load.torque) for load in scene.loads if isinstance(load, lj.Torque)])
    expected = torque[:, None] * np.asarray([1, -1]) / scene.cycle
    np.testing.assert_allclose(by_single_ends(mean_torque), expected, rtol=1e-12)


def test_the_swing_by_a_window_that_switches_with_others():
    """By differences: the window shifted separately, in both directions."""
    program, scene = compiled_soon(swing), switched_together()
    found, h = by_single_ends(swing), 1e-4
    for i, end in itertools.product(range(4), (0, 1)):

        def moved(by, i=i, end=end):
            return eqx.tree_at(
                lambda s: jax.tree.leaves(s.loads[1 + i].window)[end], scene, replace_fn=lambda x: x + by
            )

        slope = (float(program(moved(h))) - float(program(moved(-h)))) / (2 * h)
        assert found[i, end] == pytest.approx(slope, rel=1e-6)


@pytest.mark.slow
def test_diffrax_sees_single_windows_that_switch_together():
    adjoint = diffrax.RecursiveCheckpointAdjoint()
    slope = compiled_soon(jax.grad(lambda s: steady_by_diffrax(s, MANY, adjoint=adjoint).delta))(switched_together())
    found = np.asarray([[load.window.on, load.window.off] for load in slope.loads[1:]])
    np.testing.assert_allclose(found, by_single_ends(swing), rtol=1e-6)


SLOW_ROWS = [pytest.param(name, marks=pytest.mark.slow) for name in ("delta", "peak_shaking_force", "peak_reaction")]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["min_inertia_ratio", *SLOW_ROWS])
def test_rows_where_windows_switch_together(name):
    """In a panel of zero width there is no NaN; the extreme row is the measure itself."""
    measure = MEASURES[name]
    all_rows = measure.rows
    assert all_rows is not None

    @compiled_soon
    def found(scene):

        def rows(scene):
            return every_row([all_rows(measures.Parts(scene, 48))])[0].size()

        value, pull = jax.vjp(rows, scene)
        best = jax.nn.one_hot(jnp.argmin(value) if measure.smallest else jnp.argmax(value), value.size)
        return value, measure(scene, 48), pull(best)[0], pull(jnp.ones_like(value))[0]

    value, expected, slope, slopes = found(switched_together())
    assert np.all(np.isfinite(value))
    assert float(np.min(value) if measure.smallest else np.max(value)) == pytest.approx(float(expected), rel=1e-6)
    for leaf in jax.tree.leaves((slope, slopes)):
        assert np.isfinite(leaf)


@pytest.mark.slow
def test_an_analysis_where_windows_switch_together():
    """All of its values are finite, for all common ends of windows."""
    both = lj.Window(4.1887902047863905, 1.6951199159934145)
    sizes = {"a": -26.280501500841055, "b": -329.0426908961035}
    loads = tuple(lj.Torque(name, "crank", torque=size, window=both) for name, size in sizes.items())
    scene = machine("slider-crank")
    found = lj.analyse(dataclasses.replace(scene, loads=scene.loads + loads), angles=8, nodes=48)
    for name, value in measured(found).items():
        assert np.isfinite(value), name
    assert np.all(np.isfinite([found.peaks.value, found.peaks.angle]))


def test_two_designs_share_one_compilation():
    traced = []

    @jax.jit
    def run(scene):
        traced.append(scene)
        return measures.delta(scene, 32)

    scene = machine("four-bar")
    longer = eqx.tree_at(lambda s: s.mechanism.links["coupler"].length, scene, jnp.asarray(0.42, dtype=float))
    one, two = float(run(scene)), float(run(longer))
    assert one != two
    assert len(traced) == 1


def test_the_gradient_by_a_mechanism_is_a_mechanism():
    scene = machine("four-bar")
    slope = compiled_soon(jax.grad(lambda m: measures.delta(scene.with_mechanism(m), 32)))(scene.mechanism)
    assert isinstance(slope, lj.Mechanism)
    assert jax.tree.structure(slope) == jax.tree.structure(scene.mechanism)


def test_a_measure_of_ones_own():
    """One function and a decorator; it is found by name and takes part in the sweep."""
    name = "speed_range"
    try:

        @measures.measure("rad/s")
        def speed_range(of: measures.Parts) -> jax.Array:
            """Difference between the largest and the smallest speed."""
            return of.steady.max_speed - of.steady.min_speed

        scene = machine("four-bar")
        got = compiled_soon(lambda scene: measures.evaluate(scene, [MEASURES[name], measures.delta], 32))(scene)
        assert float(got[name]) == pytest.approx(float(got["delta"] * scene.speed), rel=1e-12)
        assert speed_range.unit == "rad/s" and "smallest" in speed_range.meaning
    finally:
        MEASURES.pop(name, None)
