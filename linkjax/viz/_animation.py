"""Animated GIF of the moving machine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from PIL import Image

from linkjax._display import turning
from linkjax._units import display_units
from linkjax.analysis import moves
from linkjax.machine import Scene
from linkjax.viz._machine import Stage, draw_frame, draw_links, make_stage
from linkjax.viz._skeleton import arrows, places, skeleton
from linkjax.viz._style import BLUE, FAINT, GREY, INK, TEXT, Data, closed, degrees, shade, styled

WIDTH, DPI = 5.0, 100  # inches, dots per inch
COLOURS = 96


@styled
def animate(
    data: Data, scene: Scene, path: str | Path, *, frames: int = 60, seconds: float = 4.0, units: str = "",
    angles: Sequence[float] | np.ndarray | None = None,
) -> Path:  # fmt: skip
    """Write an animated GIF of one cycle of the actual motion, slowed down to `seconds`, in an endless loop.

    Frames are at equal steps of time, so the animation shows the varying speed; without an actual motion they are at
    equal steps of crank angle. A panel below the machine shows the crank speed, in the unit given in `units` (e.g.
    "rad/s"; default rpm). With `angles` the frames are at these crank angles (rad), such as those of a run at uniform
    times, and there is no such panel. Returns the path.
    """
    turn = turning(display_units(units))
    look = skeleton(data, scene)
    strip = 0.95 if moves(data) and angles is None else 0.0
    stage = make_stage(look, WIDTH, 4.6, 0.3)
    figure = stage.figure
    height = float(figure.get_size_inches()[1])
    figure.set_size_inches(WIDTH, height + strip)
    share = height / (height + strip)
    stage.ax.set_position((0, 1 - share, 1, share * (1 - 0.3 / height)))
    draw_frame(stage, data, look)
    marker = _speed_strip(stage, data, scene, strip / (height + strip), turn) if strip else None
    title = scene.title or str(data.get("scene", ""))
    figure.text(0.03, 1 - 0.09 / (height + strip), title, size=TEXT + 1, weight="bold", va="top")
    angle_text = figure.text(0.97, 1 - 0.1 / (height + strip), "", size=TEXT, va="top", ha="right")
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    background = canvas.copy_from_bbox(figure.bbox)
    pictures = []
    shown = frame_angles(data, scene, frames) if angles is None else [float(angle) for angle in angles]
    for angle in shown:
        canvas.restore_region(background)
        at = places(data, scene, angle)
        artists = draw_links(stage, look, at, arrows(data, scene, angle))
        for artist in sorted(artists, key=lambda artist: artist.get_zorder()):
            stage.ax.draw_artist(artist)
            artist.remove()
        if marker is not None:
            ax, dot = marker
            phi = math.degrees(angle)
            speed = turn[0] * closed(data, data["motion"]["speed"])
            dot.set_data([phi], [np.interp(phi, degrees(data, scene), speed)])
            ax.draw_artist(dot)
        angle_text.set_text(f"φ = {math.degrees(angle):.0f}°")
        figure.draw_artist(angle_text)
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
    return save(pictures, Path(path), max(20, round(1000 * seconds / len(shown))))


def frame_angles(data: Data, scene: Scene, frames: int) -> list[float]:
    """Crank angles (rad) at equal steps of time over the cycle; at equal steps of angle without an actual motion."""
    angles = np.append(np.asarray(data["angles"], float), scene.cycle)
    motion = data.get("motion", {})
    timed = motion.get("time") is not None
    time = np.asarray(motion["time"] if timed else angles[:-1], float)
    end = float(motion.get("period", np.nan)) if timed else scene.cycle
    if not math.isfinite(end):
        end = float(time[-1] + (angles[-1] - angles[-2]) / np.asarray(motion["speed"], float)[-1])
    time = np.append(time, end)
    if not (np.all(np.isfinite(time)) and np.all(np.diff(time) > 0)):
        time, end = angles, scene.cycle
    return [float(phi) for phi in np.interp(np.arange(frames) * end / frames, time, angles)]


def _speed_strip(stage: Stage, data: Data, scene: Scene, share: float, turn: tuple[float, str]) -> tuple[Axes, Line2D]:
    """A small panel with the crank speed, and the dot that moves along the curve."""
    ax = stage.figure.add_axes((0.11, 0.36 * share, 0.85, 0.45 * share))
    shade(ax, data, scene)
    ax.plot(degrees(data, scene), turn[0] * closed(data, data["motion"]["speed"]), color=BLUE, linewidth=1.3)
    turns = scene.cycle_turns
    ax.set_xlim(0, 360 * turns)
    ax.set_xticks(range(0, 360 * turns + 1, 60 * turns))
    ax.locator_params(axis="y", nbins=2)
    ax.margins(y=0.2)
    ax.tick_params(labelsize=6.5, pad=1.5)
    ax.grid(color=FAINT)
    ax.set_title(f"crank speed ({turn[1]}) over crank angle (°)", fontsize=6.5, pad=2, color=GREY)
    (dot,) = ax.plot([], [], "o", color=INK, markersize=4.5, animated=True, clip_on=False)
    return ax, dot


def save(pictures: list[Image.Image], path: Path, duration: int) -> Path:
    """Write the frames with one palette of the most frequent colours, so that successive frames differ only where
    something moved."""
    some = np.stack([np.asarray(picture, np.uint32) for picture in pictures[:: max(1, len(pictures) // 4)]])
    packed, count = np.unique(some @ np.array([65536, 256, 1], np.uint32), return_counts=True)
    often = packed[np.argsort(-count)[: 4 * COLOURS]]
    chosen: list[np.ndarray] = []
    for colour in np.stack([often >> 16, often >> 8 & 255, often & 255], axis=1).astype(int):
        if all(np.max(np.abs(colour - other)) >= 8 for other in chosen[:COLOURS]):
            chosen.append(colour)
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.stack(chosen[:COLOURS]).astype(np.uint8).tobytes())
    first, *rest = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
    first.save(path, save_all=True, append_images=rest, duration=duration, loop=0, optimize=False, disposal=1)
    return path
