"""The analysed cycle, and the errors of a machine that cannot be assembled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Optional, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from linkjax._results import LENGTHS, MESSAGES, MachineError, Result
from linkjax.analysis._friction import FrictionRun, useful_share
from linkjax.analysis._html import cycle_html
from linkjax.analysis._loads import LoadRun, OnGrid, energies_of, loads_of
from linkjax.analysis._motor import MotorRun
from linkjax.analysis._table import table_of
from linkjax.analysis._text import cycle_text
from linkjax.forces import Forces
from linkjax.groups import (
    BranchPath,
    CountedTurns,
    Lost,
    ReferencePath,
    followed,
    slow,
)
from linkjax.kinematics import Least, Pose, Reversals, crank_ranges, named_groups, not_assembled_at_start, shortfall
from linkjax.loads import Window
from linkjax.machine import ReadyScene, Scene, ready
from linkjax.motion import Peak, Steady, Work
from linkjax.reduction import Reduced

CHANGE_POINT = 1e-9  # an assembly margin within this of zero is a change point
INSIDE = 0.1  # of a range of crank angles: distance of a proposed oscillation from its ends
NEARLY = 1e-6  # the same where Newton's method closes the loops, which is slow at a change point

Margins = dict[str, dict[str, Least]]
if TYPE_CHECKING:  # a script whose machine moves need not check for None
    Of = TypeVar("Of")
    Maybe = Annotated[Any, Of]
else:
    Maybe = Optional


class Checks(eqx.Module):
    """Relative residuals of the checks of an analysis; all should be near the rounding error.

    `virtual_power`: drive torque by kinetostatics against the reduced model. `energy_closure`: kinetic energy of the
    links against the work of each load, integrated separately (None without actual motion). `force_balance`: force and
    moment on the frame against shaking force, weight, loads and drive torque.
    """

    virtual_power: Array
    energy_closure: Maybe[Array]
    force_balance: Array


class Flywheels(eqx.Module):
    """Flywheel inertias (kg m²): given, exact for the scene's target δ, and by the textbook formula ΔA/(δω²)."""

    given: Array
    for_target_delta: Array | None
    textbook: Array | None


class NoMotion(eqx.Module):
    """Why a cycle has no actual motion: the `reason` with a remedy, in one line, and whether it `fails` (a machine
    without any mass does not fail: it has kinematics and statics). `steady_state_margin` is that of the cycle;
    `min_mean_speed` (rad/s) is the lowest mean speed with a steady-state motion, if the speed is too low."""

    reason: str = eqx.field(static=True)
    fails: bool = eqx.field(static=True)
    steady_state_margin: Array | None
    min_mean_speed: Array | None


class Cycle(eqx.Module):
    """The analysis of a working cycle. Arrays run over `angles` (rad); SI units throughout.

    `strokes` are the ranges of sliders (m) and links (rad) between their `dead_centres`.
    `forces` are those of the actual motion, `forces_constant_speed` those at constant nominal speed. `peaks` and
    `peaks_constant_speed` hold the peaks of the continuous cycle in the order of `peak_names`. `transmission_ends` are
    the transmission angles (rad) where the margins are least. `work` is the work of the drive, of weight and of each
    load per cycle (J). `windows` are the ranges of crank angle (rad) of loads whose window is given by what happens, by
    load: arrays `on` and `off`, equal where a range is not used. `motor` is what a motor does at its own shaft, and
    `on_grid` the reduced model at the nodes of the cycle grid. `friction` is what the friction of joints does in the
    motion of `forces`, None without friction.

    If no actual motion exists, `missing` gives the reason, and `steady`, `speed`, `acceleration`, `time`, `forces`,
    `peaks`, `friction`, `work` and `checks.energy_closure` are None; so is `flywheel`, unless it holds the inertia for
    target δ.
    With `constant_speed` they are None, too, except `forces`, which are those at constant speed; `missing` is None.
    `print(cycle)` shows a summary, a notebook the machine and its curves as well. `cycle.table()` has the columns over
    the crank angle.
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
    windows: dict[str, Window] = eqx.field(default_factory=dict)
    motor: MotorRun | None = None
    on_grid: OnGrid | None = None
    friction: FrictionRun | None = None
    friction_constant_speed: FrictionRun | None = None

    def __str__(self) -> str:
        return cycle_text(self)

    def _repr_html_(self) -> str | None:
        return cycle_html(self)

    def table(self) -> dict[str, np.ndarray]:
        """Everything over the crank angle as named columns (SI), one row per crank angle: `pandas.DataFrame` takes it
        as it is.

        Names are those of the CSV files, see `docs/json.md`: `crank_angle`, `x_B`, `dx_B`, `angle_rod`, `speed`,
        `drive_torque`, `fx_B_rod`, … Columns of an actual motion that does not exist are absent. Raises
        `StructureError` where two columns have the same name, and `ValueError` for a batch of cycles.
        """
        return table_of(self)

    @property
    def delta(self) -> Any:
        """Coefficient of speed fluctuation of the actual motion; None without one."""
        return None if self.steady is None else self.steady.delta

    @property
    def delta_error(self) -> Any:
        """Bound of the absolute error of `delta`."""
        return None if self.steady is None else self.steady.delta_error

    @property
    def power(self) -> Any:
        """Power of the drive on the crank in the actual motion at `angles` (W); None without one."""
        if self.steady is None or self.speed is None or self.forces is None:
            return None
        torque = self.steady.mean_drive_torque if self.steady.driven is None else self.forces.drive_torque
        return torque * self.speed

    @property
    def mean_power(self) -> Any:
        """Work of the drive per cycle divided by its duration (W); None without actual motion."""
        return None if self.steady is None or self.work is None else self.work["drive"] / self.steady.period

    @property
    def energies(self) -> Maybe[dict[str, Work]]:
        """Work per cycle by source and sink (J), `supplied` and `absorbed` each zero or more: of the "motor" at its own
        shaft and its "transmission", or of the "drive" on the crank without a motor; of "gravity"; and of each load by
        name. In the actual motion, or at constant speed without one. All that is supplied is absorbed. None where loads
        depend on the speed of a motion that does not exist. They are computed on every call."""
        return energies_of(self)

    @property
    def loads(self) -> Maybe[dict[str, LoadRun]]:
        """What each load does over the cycle, by name, and "gravity": `force` and `power` at `angles`, and its work per
        cycle, `supplied`, `absorbed`, and the difference `energy`. In the motion of `energies`, and None as they are.
        They are computed on every call."""
        return loads_of(self, self.energies)

    @property
    def efficiency(self) -> float | None:
        """Work on the useful loads over the net work of the drive (of the motor at its shaft), per cycle, in the motion
        of `energies`; zero where friction locks the machine, None if the scene has no useful loads."""
        return useful_share(self)

    @property
    def reactions(self):
        """Joint reactions of `forces`: `reactions[joint][link]` with `fx`, `fy`, `moment`, acting on the link. Raises
        `MachineError` if no actual motion exists; `forces_constant_speed` has those at constant speed."""
        if self.forces is None:
            why = "no actual motion" if self.missing is None else self.missing.reason
            raise MachineError(f"{why} Use forces_constant_speed.reactions.", Result(int(self.result)))
        return self.forces.reactions


def explain_start(made: ReadyScene) -> None:
    """Raise `MachineError` if a group of higher class does not close at crank angle zero, before any analysis."""
    scene = made.scene
    for name, (group, path) in made.mechanism.along().items():
        if not isinstance(path, ReferencePath):
            continue
        if not float(path.gap[0]) > slow(path.gap.dtype):
            continue
        lost = not_assembled_at_start(made.mechanism)
        if lost is not None and lost[0] != name:
            return  # it is attached to a group that does not close; the analysis reports where that one closes
        title = f"Scene {scene.title!r}: " if scene.title else ""
        left = float(path.gap[0] * path.size)
        joints = ", ".join(sorted({joint.name for joint in group.joints()}))
        law = group.follows()
        remedy = "Change lengths or the phase of the crank, or sketch its pins at their positions at crank angle zero."
        if law is not None:
            slides, begins = group.drive_slides(), law.begins()
            which = f"stroke, which begins at {begins:.4g} m" if slides else f"law, which begins at {begins:.4g} rad"
            remedy = f"Change its {which}, or lengths, or sketch its pins at their positions there."
        raise MachineError(
            f"{title}group {name!r} cannot be assembled at crank angle zero: the loops do not close; the smallest "
            f"gap is {left:.3g} m, at joints {joints}. {remedy}", Result.CANNOT_BE_ASSEMBLED,
        )  # fmt: skip


def explain(cycle: Cycle) -> None:
    """Raise `MachineError` if a machine cannot be assembled, with the reason, the place and the remedy."""
    code = Result(int(cycle.result))
    title = f"Scene {cycle.scene.title!r}: " if cycle.scene.title else ""
    if code is Result.CANNOT_BE_ASSEMBLED:
        group, side, at = _first_lost(cycle)
        what, remedy = _what_is_lost(cycle, group, side, at)
        raise MachineError(f"{title}group {group!r} {what}. {remedy or MESSAGES[code]}", code)


def _what_is_lost(cycle: Cycle, group: str, side: str, at: Least) -> tuple[str, str]:
    """The problem of a group whose margin is not positive, and the remedy; "" for the general remedy."""
    here, of = named_groups(cycle.scene.mechanism)[group], cycle.scene.mechanism
    found = Lost(side, float(at.value), float(jnp.degrees(at.angle)), _trouble(cycle, group))
    if (told := here.lost(found)) is not None:
        return told
    if -found.value > (NEARLY if here.numerical() else CHANGE_POINT) or found.trouble == "ends":
        what = f"cannot be assembled at {found.place}: {shortfall(of, group, side, at.angle)}"
        return what, _where_it_can(cycle)
    remedy = ""
    if here.continued() is not None:
        where = "at the top of the scene" if any(link.pins for link in of.links.values()) else "in the group"
        remedy = f'Set branch = "continue" {where} for a smooth motion, or change a length.'
    what = f"has a change point at {found.place}: its two assembly modes coincide there, so the motion is undetermined"
    return what, remedy


def _where_it_can(cycle: Cycle) -> str:
    """The remedy: other lengths. Unless the crank rotates fully, also the ranges of crank angle in which it can be
    assembled, and an oscillation inside the first, which begins, if possible, where the mechanism is drawn and phases
    and sides hold."""
    mechanism = cycle.scene.mechanism
    crank, law = mechanism.driver, mechanism.driver.follows()
    if (sense := crank.shaft()) is None:
        return LENGTHS
    ranges = crank_ranges(mechanism, cycle.scene.cycle_turns)
    if not ranges:
        return f"It can be assembled at no crank angle. {LENGTHS}"
    if not ranges[0].at_start and not ranges[0].at_stop:
        return LENGTHS
    between = " and ".join(f"{math.degrees(r.start):.4f} to {math.degrees(r.stop):.4f} degrees" for r in ranges)
    low, high = ranges[0].start, ranges[0].stop
    inset = INSIDE * (high - low)
    ends, drawn = (low + inset, high - inset), ""
    if followed(mechanism.groups):
        begin = 0.0 if law is None else law.begins()
        if low < begin < high:
            ends = begin, max(ends, key=lambda end: abs(end - begin))
        else:
            general = any(group.spots() for group in mechanism.groups)
            drawn = f", and {'draw it' if general else 'give phases and sides'} at its start"
    swing = ", ".join(
        f'{key} = "{math.degrees(end * sense) + 0.0:.4f} deg"' for key, end in zip(("start", "stop"), ends, strict=True)
    )
    key = "drive.law" if any(link.pins for link in mechanism.links.values()) else "groups[0].law"
    has = "its motion law exceeds that range" if law is not None else "its crank cannot rotate fully"
    inside = "this range" if len(ranges) == 1 else "the first range"
    return (
        f"It can be assembled from {between} of crank angle, and {has}: prescribe an oscillation within {inside}, "
        f"e.g. {key} = {{ {swing} }}{drawn}, or change lengths of its links until every margin is positive."
    )


def _trouble(cycle: Cycle, name: str) -> str:
    """The problem of a group with a reference path that closes everywhere, or of the turns that gears follow."""
    path = ready(cycle.scene).mechanism.along()[name].path
    turns = path.meshing.turns if isinstance(path, ReferencePath) else path
    if isinstance(turns, CountedTurns) and bool(turns.too_fast()):
        return "too fast"
    return path.trouble() if isinstance(path, BranchPath | ReferencePath) else ""


def _first_lost(cycle: Cycle) -> tuple[str, str, Least]:
    """The first group that cannot be assembled, at its least margin; later groups are attached to it."""
    names = [name for name in named_groups(cycle.scene.mechanism) if name in cycle.margins]
    worst = [(name, *min(cycle.margins[name].items(), key=lambda side: float(side[1].value))) for name in names]
    least = min(worst, key=lambda each: float(each[2].value))
    return next((each for each in worst if not float(each[2].value) > 0), least)
