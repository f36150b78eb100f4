"""The machine to scale, and in motion."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from matplotlib.patches import Circle, FancyArrowPatch, Wedge
from PIL import Image

import linkjax as lj
from linkjax import viz
from linkjax.viz._animation import frame_angles
from linkjax.viz._labels import overlap, place_labels
from linkjax.viz._machine import JOINT, machine_figure
from linkjax.viz._skeleton import Skeleton, arrows, places, skeleton
from tests.viz.cycles import SCENES, STANDARD, analysed


def markers(figure, radius: float) -> np.ndarray:
    """Centres of all circles of a radius in points, in metres."""
    ax = figure.axes[0]
    unit = np.ptp(ax.get_xlim()) / (72 * figure.get_size_inches()[0])
    circles = [
        p for p in ax.patches if isinstance(p, Circle) and math.isclose(p.get_radius(), radius * unit, rel_tol=1e-9)
    ]
    return np.array([circle.center for circle in circles])


@pytest.mark.parametrize("index", [0, 45, 200])
@pytest.mark.parametrize("name", SCENES)
def test_joints_stand_where_the_data_says(name, index):
    scene, data = analysed(name)
    figure = machine_figure(data, scene, float(data["angles"][index]))
    joints = {p for group in scene.mechanism.groups for ends in group.pins().values() for p in ends if p}
    joints |= {load.to_point for load in scene.loads if isinstance(load, lj.Spring) if load.to_point}
    wanted = np.array([[np.ravel(data["points"][p][k])[index] for k in ("x", "y")] for p in joints])
    drawn = markers(figure, JOINT)
    assert len(drawn) == len(joints)
    distance = np.hypot(*(wanted[:, None] - drawn[None]).transpose(2, 0, 1))
    assert np.max(np.min(distance, axis=1)) < 1e-12


@pytest.mark.parametrize("name", SCENES)
def test_the_drawing_is_to_scale_and_holds_the_cycle(name):
    scene, data = analysed(name)
    figure = machine_figure(data, scene)
    ax = figure.axes[0]
    box = ax.get_position()
    wide, high = figure.get_size_inches()
    scales = np.ptp(ax.get_xlim()) / (box.width * wide), np.ptp(ax.get_ylim()) / (box.height * high)
    assert scales[0] == pytest.approx(scales[1], rel=1e-9)
    look = skeleton(data, scene)
    assert ax.get_xlim()[0] < look.low[0] and look.high[0] < ax.get_xlim()[1]
    assert ax.get_ylim()[0] < look.low[1] and look.high[1] < ax.get_ylim()[1]
    heavy = [link for link in scene.mechanism.links.values() if float(link.actual().mass) > 0]
    assert sum(isinstance(patch, Wedge) for patch in ax.patches) == 2 * len(heavy)
    texts = [text.get_text() for text in ax.texts]
    named = {name for text in texts for name in text.split(", ")}
    assert set(look.joints) | {link.centre_name for link in heavy} <= named


@pytest.mark.parametrize(("degrees", "count"), [(0.0, 0), (89.9, 0), (90.0, 1), (200.0, 1), (334.9, 1), (335.0, 0)])
def test_loads_are_drawn_in_their_window(degrees, count):
    scene, data = analysed("hay-press")
    figure = machine_figure(data, scene, math.radians(degrees))
    found = [patch for patch in figure.axes[0].patches if isinstance(patch, FancyArrowPatch)]
    assert len(found) == count


def test_a_guide_lies_under_the_stroke_of_its_pin():
    scene, data = analysed("slider-crank")
    (guide,) = skeleton(data, scene).guides
    pin = data["points"]["P"]
    assert guide.block == "piston"
    assert guide.angle == pytest.approx(0.0, abs=1e-12)
    assert guide.ends[0] == pytest.approx([np.min(pin["x"]), 0.008])
    assert guide.ends[1] == pytest.approx([np.max(pin["x"]), 0.008])


@pytest.mark.parametrize("name", SCENES)
def test_places_between_the_angles(name):
    """Cubic Hermite interpolation on every fourth angle against the angles in between: fourth order, or less
    with a motion law."""
    scene, data = analysed(name)
    size = skeleton(data, scene).size

    def thinned(step: int):
        points = {p: {k: np.broadcast_to(v, 360)[::step] for k, v in of.items()} for p, of in data["points"].items()}
        links = {n: {k: np.broadcast_to(v, 360)[::step] for k, v in of.items()} for n, of in data["links"].items()}
        return {**data, "angles": data["angles"][::step], "points": points, "links": links}

    def error(step: int) -> float:
        few = thinned(step)
        worst = 0.0
        for i in range(step // 2, 360, step):
            at = places(few, scene, float(data["angles"][i]))
            worst = max(worst, *(math.hypot(at[p][0] - np.broadcast_to(of["x"], 360)[i],
                                            at[p][1] - np.broadcast_to(of["y"], 360)[i])
                                 for p, of in data["points"].items()))  # fmt: skip
        return worst / size

    assert error(2) < 1e-5
    law = scene.mechanism.driver.follows()  # made of pieces
    assert error(4) < (16 if law is None else 64) * 1.5 * error(2)


@pytest.mark.parametrize("name", SCENES)
def test_the_view_is_plain_data_in_the_picture(name):
    scene, data = analysed(name)
    view = json.loads(json.dumps(viz.machine_view(data, scene), allow_nan=False))
    (machine,) = view["machines"]
    for point, at in machine["points"].items():
        x, y = (np.ravel(data["points"][point][k]) for k in ("x", "y"))
        assert np.allclose(at["x"], x, rtol=1e-8, atol=1e-9)
        assert np.all(np.abs(view["left"] + view["scale"] * x - view["width"] / 2) < view["width"] / 2)
        assert np.all(np.abs(view["base"] - view["scale"] * y - view["height"] / 2) < view["height"] / 2)
    assert view["time"][-1] == pytest.approx(data["motion"]["period"], rel=1e-8)
    assert {link["name"] for link in machine["links"]} == set(scene.mechanism.links)
    assert len(machine["loads"]) == sum(not isinstance(load, lj.Spring | lj.Damper) for load in scene.loads)
    still = {key: data[key] for key in ("angles", "points", "links")}
    assert viz.machine_view(still, scene)["time"] is None


def test_the_machine_before_is_part_of_the_drawing():
    scene, data = analysed("slider-crank")
    wide = {**data, "points": {p: {k: 3 * np.asarray(v) for k, v in at.items()} for p, at in data["points"].items()}}
    alone, both = machine_figure(data, scene), machine_figure(data, scene, before=wide)
    assert len(both.axes[0].lines) > len(alone.axes[0].lines)
    assert np.ptp(both.axes[0].get_xlim()) > 2 * np.ptp(alone.axes[0].get_xlim())


def test_labels_keep_clear(rng):
    spots = rng.uniform(60, 340, size=(14, 2))
    names = [f"P{i}" for i in range(14)]
    limits = (0.0, 0.0, 400.0, 400.0)
    found = place_labels(names, spots, spots, np.zeros((0, 2)), size=8.5, limits=limits)
    boxes = [(x - 9, y - 4.6, x + 9, y + 4.6) for x, y in found]
    assert not any(overlap(one, two) for i, one in enumerate(boxes) for two in boxes[:i])
    assert all(limits[0] < b[0] and limits[1] < b[1] and b[2] < limits[2] and b[3] < limits[3] for b in boxes)


def test_a_lost_machine_still_has_a_picture():
    scene, data = analysed("four-bar")
    lost = {**data, "result": {"code": 3, "message": "lost", "per_angle": np.full(len(data["angles"]), 3)}}
    assert isinstance(skeleton(lost, scene), Skeleton)
    machine_figure(lost, scene).canvas.draw()


@pytest.mark.parametrize("name", SCENES)
def test_animation(name, tmp_path):
    scene, data = analysed(name)
    path = viz.animate(data, scene, tmp_path / "machine.gif")
    assert path.stat().st_size <= 1.2e6
    with Image.open(path) as gif:
        assert getattr(gif, "n_frames", 1) == 60
        assert gif.info["loop"] == 0
        frames = []
        for index in (0, 30):
            gif.seek(index)
            frames.append(np.asarray(gif.convert("RGB"), int))
    assert np.any(frames[0] != frames[1])
    assert tuple(frames[0][2, frames[0].shape[1] // 2]) == (255, 255, 255)


@pytest.mark.parametrize("name", SCENES)
def test_frames_are_equal_steps_of_time(name):
    scene, data = analysed(name)
    angles = frame_angles(data, scene, 60)
    assert angles[0] == 0
    assert np.all(np.diff(angles) > 0)
    time = np.interp(
        angles, np.append(data["angles"], scene.cycle), np.append(data["motion"]["time"], data["motion"]["period"])
    )
    assert np.allclose(np.diff(time), data["motion"]["period"] / 60)
    still = {key: part for key, part in data.items() if key != "motion"}
    assert np.allclose(np.diff(frame_angles(still, scene, 60)), scene.cycle / 60)


def test_animation_without_a_motion(tmp_path):
    scene, data = analysed("four-bar")
    still = {key: data[key] for key in ("angles", "points", "links")}
    path = viz.animate(still, scene, tmp_path / "still.gif", frames=4)
    with Image.open(path) as gif:
        assert getattr(gif, "n_frames", 1) == 4


def test_files(tmp_path):
    scene, data = analysed("slider-crank")
    written = viz.write_figures(data, scene, tmp_path / "new" / "folder")
    names = [picture.name for picture in STANDARD if picture.name != "friction"]
    assert [path.name for path in written] == [f"{name}{kind}" for name in names for kind in (".png", ".svg")]
    with Image.open(written[0]) as image:
        assert image.width == 1080  # 7.2 inches at 150 dpi
    assert all(path.read_text(encoding="utf-8").startswith("<?xml") for path in written[1::2])


def test_files_of_a_part_are_the_same_every_time(tmp_path):
    scene, data = analysed("slider-crank")
    part = {key: data[key] for key in ("angles", "reduced", "flywheel")}
    first, second = (viz.write_figures(part, scene, tmp_path / name) for name in "ab")
    assert [path.name for path in first] == ["inertia.png", "inertia.svg", "torque.png", "torque.svg"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_arrows_of_loads_of_varying_size():
    """A table and a resistance are drawn as they act at the angle, and not where they vanish."""
    scene, data = analysed("quick-return")
    link = scene.mechanism.driving_link
    loads = (lj.Table.row("cloth", link, values=[3.0, -5.0, 0.0]), lj.DragTorque("fan", link, linear=1.0))
    scene = dataclasses.replace(scene, loads=loads)
    places = np.asarray(data["angles"])[[0, 100, 200]]
    turns = np.zeros(len(data["angles"]))
    turns[[0, 100]] = 3.0, -5.0
    data = {**data, "loads": {"cloth": {"moment": turns}, "fan": {"moment": np.full(len(turns), -2.0)}}}
    one, two, three = ([(arrow.text, arrow.turn) for arrow in arrows(data, scene, angle)] for angle in places)
    assert one == [("cloth 3 N·m", 1), ("fan 2 N·m", -1)]
    assert two == [("cloth 5 N·m", -1), ("fan 2 N·m", -1)]
    assert three == [("fan 2 N·m", -1)]
    drawn = viz.machine_view(data, scene)["machines"][0]["loads"]
    assert [drawn[0]["text"][i] for i in (0, 100)] == ["cloth 3 N·m", "cloth 5 N·m"]
    assert [[load["turn"][i] for i in (0, 100, 200)] for load in drawn] == [[1, -1, 0], [-1, -1, -1]]
    across = np.where(turns > 0, 4.0, 0.0)
    data = {**data, "loads": {"fan": {"fx": -0.75 * across, "fy": across}}}
    (drawn,) = viz.machine_view(data, scene)["machines"][0]["loads"]
    assert [drawn["along"][i] for i in (0, 200)] == [[-0.6, 0.8], [0.0, 0.0]]
    assert drawn["text"][0] == "fan 5 N"
