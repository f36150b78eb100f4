"""A working cycle, computed, and why one could not be."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Optional, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from linkjax._results import LENGTHS, MESSAGES, MachineError, Result
from linkjax.analysis._table import table_of
from linkjax.analysis._text import cycle_text
from linkjax.forces import Forces
from linkjax.groups import FITS, RRP, RRR, Course, Crank, Gear, General, Pinion, Rack, Track, followed, slow
from linkjax.kinematics import Least, Pose, Reversals, crank_ranges, lost_at_start, named_groups, shortfall
from linkjax.machine import Scene, ready
from linkjax.motion import Peak, Steady
from linkjax.reduction import Reduced

CHANGE_POINT = 1e-9  # an assembly margin within this of zero is a change point
INSIDE = 0.1  # of a range of crank angles: how far inside it the law that is proposed stays
NEARLY = 1e-6  # or within this, where Newton's method closes the loops: at a change point it is slow

Margins = dict[str, dict[str, Least]]
if TYPE_CHECKING:  # a script that knows of its machine that it moves need not ask whether it does
    Of = TypeVar("Of")
    Maybe = Annotated[Any, Of]
else:
    Maybe = Optional


class Checks(eqx.Module):
    """Relative residuals of the analysis's own checks; all should be near rounding.

    `virtual_power`: drive torque by kinetostatics against the reduced model. `energy_closure`: kinetic energy of the
    links against the work of each load, integrated separately (None without actual motion). `force_balance`: force and
    moment on the frame against shaking force, weight, loads and drive torque.
    """

    virtual_power: Array
    energy_closure: Maybe[Array]
    force_balance: Array


class Flywheels(eqx.Module):
    """Flywheel inertias (kg m²): given, needed for the scene's target δ exactly, and by the textbook's ΔA/(δω²)."""

    given: Array
    for_target_delta: Array | None
    textbook: Array | None


class NoMotion(eqx.Module):
    """Why a cycle has no actual motion: the `reason` with what would give one, in one line, and whether that `fails`
    what was asked (a machine without any mass has kinematics and statics, and nothing else). The regime margin and,
    where the mean speed is too low, the lowest (rad/s) that has a steady motion."""

    reason: str = eqx.field(static=True)
    fails: bool = eqx.field(static=True)
    steady_state_margin: Array | None
    min_mean_speed: Array | None


class Cycle(eqx.Module):
    """A working cycle, computed. Arrays run over `angles` (rad); SI units throughout.

    `strokes` are what sliders (m) and links (rad) cover between their `dead_centres`.
    `forces` belong to the motion asked for, `forces_constant_speed` to constant nominal speed; `peaks` and
    `peaks_constant_speed` hold the continuous cycle's peaks in the order of `peak_names`; `transmission_ends` are the
    transmission angles (rad) where the margins are least; `work` is what drive, weight and each load do in a cycle (J).

    Where the actual motion does not exist `missing` says why, and `steady`, `speed`, `acceleration`, `time`, `forces`,
    `peaks`, `work` and `checks.energy_closure` are None, and so is `flywheel`, unless it holds the one that gives the
    target δ. With `constant_speed` the actual motion is not asked for: these are None, too, but `forces`, which are
    those at constant speed, and `missing`.
    """

    scene: Scene
    angles: Float[Array, " angles"]
    pose: Pose
    transmission: dict[str, Array]
    transmission_ends: dict[str, Float[Array, " sides"]]
    margins: Margins
    dead_centres: dict[str, Reversals]
    strokes: dict[str, Array]
    reduced: Reduced
    steady: Maybe[Steady]
    speed: Maybe[Float[Array, " angles"]]
    acceleration: Maybe[Float[Array, " angles"]]
    time: Maybe[Float[Array, " angles"]]
    forces: Maybe[Forces]
    forces_constant_speed: Forces
    peaks: Maybe[Peak]
    peaks_constant_speed: Peak
    rms_shaking_force_constant_speed: Array
    flywheel: Maybe[Flywheels]
    work: Maybe[dict[str, Array]]
    checks: Checks
    assembled: Bool[Array, " angles"]
    result: Int[Array, ""]
    constant_speed: bool = eqx.field(static=True)
    method: str = eqx.field(static=True, default="quadrature")
    nodes: int = eqx.field(static=True, default=0)
    missing: NoMotion | None = None

    def __str__(self) -> str:
        return cycle_text(self)

    def table(self) -> dict[str, np.ndarray]:
        """Everything over the crank angle as named columns (SI), one row per crank angle: `pandas.DataFrame` takes it
        as it is.

        Names are those of the CSV files, see `docs/conventions.md`: `crank_angle`, `x_B`, `dx_B`, `angle_rod`, `speed`,
        `drive_torque`, `fx_B_rod`, … Columns of an actual motion that does not exist are absent. Raises
        `StructureError` where two columns have the same name, and `ValueError` for a batch of cycles.
        """
        return table_of(self)

    @property
    def delta(self) -> Any:
        """Coefficient of speed fluctuation of the actual motion; None where there is none."""
        return None if self.steady is None else self.steady.delta

    @property
    def delta_error(self) -> Any:
        """Bound of the absolute error of `delta`."""
        return None if self.steady is None else self.steady.delta_error

    @property
    def power(self) -> Any:
        """Power of the constant drive torque in the actual motion at `angles` (W); None without one."""
        return None if self.steady is None or self.speed is None else self.steady.mean_drive_torque * self.speed

    @property
    def mean_power(self) -> Any:
        """Work of the drive in a cycle over its duration (W); None without actual motion."""
        return None if self.steady is None or self.work is None else self.work["drive"] / self.steady.period

    @property
    def reactions(self):
        """Joint reactions: `reactions[joint][link]` with `fx`, `fy`, `moment`, acting on the link, in the motion asked
        for. Raises `MachineError` where that does not exist; `forces_constant_speed` has those at constant speed."""
        if self.forces is None:
            why = "no actual motion" if self.missing is None else self.missing.reason
            raise MachineError(f"{why} Read forces_constant_speed.reactions.", Result(int(self.result)))
        return self.forces.reactions


def explain_start(scene: Scene) -> None:
    """Raise `MachineError` where a general group of a prepared scene does not close at crank angle zero: what is not to
    be had from its sketch needs no analysis to tell."""
    for name, group in named_groups(scene.mechanism).items():
        if not isinstance(group, General) or group.path is None:
            continue
        if not float(group.path.gap[0]) > slow(group.path.gap.dtype):
            continue
        lost = lost_at_start(scene.mechanism)
        if lost is not None and lost[0] != name:
            return  # it hangs on what does not close there, and the analysis tells where that does
        title = f"Scene {scene.title!r}: " if scene.title else ""
        assert group.path.size is not None
        left = float(group.path.gap[0] * group.path.size)
        joints = ", ".join(sorted({joint.name for joint in group.joints()}))
        law = group.follows()
        remedy = "Change lengths, or the phase of the crank, or sketch its pins where they are at crank angle zero."
        if law is not None:
            slides = group.driven_slot() is not None
            begins = law.begins()
            told = f"stroke, which begins at {begins:.4g} m" if slides else f"law, which begins at {begins:.4g} rad"
            remedy = f"Change its {told}, or lengths, or sketch its pins where they are there."
        raise MachineError(
            f"{title}group {name!r} cannot be assembled at crank angle zero: as near as its joints ({joints}) come, "
            f"{left:.3g} m are left open. {remedy}", Result.CANNOT_BE_ASSEMBLED,
        )  # fmt: skip


def explain(cycle: Cycle) -> None:
    """Raise `MachineError` when a machine cannot be assembled, saying what falls short, where, and what to change."""
    code = Result(int(cycle.result))
    title = f"Scene {cycle.scene.title!r}: " if cycle.scene.title else ""
    if code is Result.CANNOT_BE_ASSEMBLED:
        group, side, at = _first_lost(cycle)
        what, remedy = _what_is_lost(cycle, group, side, at)
        raise MachineError(f"{title}group {group!r} {what}. {remedy or MESSAGES[code]}", code)


def _what_is_lost(cycle: Cycle, group: str, side: str, at: Least) -> tuple[str, str]:
    """What is wrong with a group whose margin is not positive, and what to do; "" for what always helps."""
    degrees, short, trouble = float(jnp.degrees(at.angle)), -float(at.value), _trouble(cycle, group)
    place = f"{degrees:.2f} degrees of crank angle ({side})"
    if side == "parallel":
        return (
            f"cannot be assembled over the cycle: at {place} its slots point past each other, on the other side than "
            "given; change the side, or the slots so that they are never parallel"
        ), ""
    if side == "apart":
        return (
            "has wheels whose axes are too near to each other for their belt, or coincide with teeth between them; "
            "change radii, or the distance"
        ), ""
    if side == "fits":
        return f"does not fit: at {degrees:.2f} degrees it is off by {(short + 1) * FITS:.3g} of its length", ""
    if trouble == "too fast":
        what = "has wheels that follow a link which turns too fast, somewhere in the cycle, for its turns to be counted"
        return what, "Let that link turn less unevenly, or fewer times a turn of the crank."
    if side == "turns" or trouble == "astray":
        what = "is not after the cycle where it began: it goes on for more turns (cycle_turns)"
        return what, "Write more turns, or choose another ratio." if side == "turns" else ""
    if side == "loops" and trouble == "change point":
        return f"passes on to another assembly near {place}: it has a change point or a dead position there", ""
    if short > (NEARLY if side == "loops" else CHANGE_POINT) or trouble == "ends":
        what = f"cannot be assembled at {place}: {shortfall(cycle.scene.mechanism, group, side, at.angle)}"
        where = _where_it_can(cycle)
        names_none = isinstance(named_groups(cycle.scene.mechanism)[group], General)
        return what, (where or "Change lengths of its links.") if names_none else where + LENGTHS
    remedy = ""
    if isinstance(named_groups(cycle.scene.mechanism)[group], RRR | RRP):
        drawn = any(link.pins for link in cycle.scene.mechanism.links.values())
        where = "at the top of the scene" if drawn else "in the group"
        remedy = f'Write branch = "continue" {where} to go on smoothly, or change a length.'
    return f"has a change point at {place}: its two assemblies meet there, and which it takes is chance", remedy


def _where_it_can(cycle: Cycle) -> str:
    """The ranges of crank angle in which it can be assembled, and a law inside the first; nothing for a crank that
    rotates fully. The law begins, if it can, where groups are drawn, turns are counted from and sides hold."""
    mechanism = cycle.scene.mechanism
    crank = mechanism.groups[0]
    if not isinstance(crank, Crank):
        return ""
    ranges = crank_ranges(mechanism, cycle.scene.cycle_turns)
    if not ranges:
        return "It can be assembled at no crank angle. "
    if not ranges[0].at_start and not ranges[0].at_stop:
        return ""
    told = " and ".join(f"{math.degrees(r.start):.4f} to {math.degrees(r.stop):.4f} degrees" for r in ranges)
    low, high = ranges[0].start, ranges[0].stop
    inset = INSIDE * (high - low)
    ends, drawn = (low + inset, high - inset), ""
    if followed(mechanism.groups):
        begin = 0.0 if crank.law is None else crank.law.begins()
        if low < begin < high:
            ends = begin, max(ends, key=lambda end: abs(end - begin))
        else:
            general = any(isinstance(group, General) and group.sketch for group in mechanism.groups)
            drawn = f", and {'draw it' if general else 'give phases and sides'} where that begins"
    law = ", ".join(
        f'{key} = "{math.degrees(end * crank.sense) + 0.0:.4f} deg"'
        for key, end in zip(("start", "stop"), ends, strict=True)
    )
    key = "drive.law" if any(link.pins for link in mechanism.links.values()) else "groups[0].law"
    has = "its law goes beyond that" if crank.law is not None else "its crank does not come round"
    return (
        f"It can be assembled from {told} of crank angle, and {has}: let it swing inside, e.g. {key} = {{ {law} }}"
        f"{drawn}, or change lengths. "
    )


def _trouble(cycle: Cycle, name: str) -> str:
    """What is wrong with a followed group that closes everywhere, or with the turns that wheels follow."""
    group = named_groups(ready(cycle.scene).mechanism)[name]
    path = getattr(group, "path", None)
    if isinstance(group, General | Gear | Rack | Pinion):
        wound = path.wound if isinstance(path, Track) else path
        if wound is not None and bool(wound.too_fast(group.cycle_turns)):
            return "too fast"
    return path.trouble() if isinstance(path, Course | Track) else ""


def _first_lost(cycle: Cycle) -> tuple[str, str, Least]:
    """The first group that cannot be assembled, at its worst: those behind it hang on what is none."""
    names = [name for name in named_groups(cycle.scene.mechanism) if name in cycle.margins]
    worst = [(name, *min(cycle.margins[name].items(), key=lambda side: float(side[1].value))) for name in names]
    least = min(worst, key=lambda each: float(each[2].value))
    return next((each for each in worst if not float(each[2].value) > 0), least)
