"""Keys of other programs that scene files do not have, or have under another name, and the messages about them.

Each row of `ABSENT` is one missing feature. When the feature is added, its row is deleted, or those of its words that
have become keys; `tests/scenes/test_absent.py` fails while a row names a key of the format.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from linkjax.scenes._keys import Path, lookup

MEANT = {  # words of other programs and textbooks for a key of the same table
    "length": "radius l size",
    "mass": "weight m",
    "inertia": "moment_of_inertia mass_moment_of_inertia moi rotational_inertia izz i_g",
    "centre": "center center_of_mass centre_of_mass mass_center mass_centre centroid cog com cg",
    "points": "markers coupler_points",
    "pins": "joints nodes ends connections vertices",
    "link": "body member part bar",
    "point": "location application_point",
    "force": "magnitude load",
    "torque": "moment couple",
    "window": "interval range active",
    "phase": "angle initial_angle start_angle theta theta0",
    "on": "against base reference",
    "law": "motion_law motion profile displacement",
    "block": "slider",
    "guide": "axis rail",
    "teeth": "z tooth_numbers",
    "speed": "rpm omega w angular_velocity angular_speed rotational_speed velocity input_speed crank_speed",
    "title": "name description",
    "rotation": "direction sense clockwise",
    "gravity": "g",
    "fixed": "ground grounds anchors anchor supports base frame fixed_points fixed_joints ground_points",
    "links": "bars bar bodies members segments parts",
    "drive": "driver input input_link",
    "loads": "load forces force moments moment torques torque external_forces applied_forces couples",
    "gears": "gear gear_pairs gear_train belts belt chains chain pulleys pulley sprockets",
    "racks": "rack_and_pinion",
    "cycle_turns": "turns cycles revolutions",
    "target_delta": "delta fluctuation coefficient_of_fluctuation",
    "limits": "constraints",
    "free": "variables design_variables parameters",
    "minimise": "minimize objective",
    "maximise": "maximize",
}


class Absent(NamedTuple):
    """A missing feature: its words, the tables in which they mean it ("" for the top of the file, "*" for all tables),
    and the message."""

    words: str
    tables: str
    says: str


MOTOR = (
    "there is no [motor] yet (it will give the driving torque); until then the drive applies the constant torque that "
    "balances the cycle, at the mean `speed`"
)
ONE_DRIVE = (
    "linkjax has one drive, for machines of one degree of freedom: keep one, and couple other cranks to it by gears; "
    "model a piston that is driven by gas as a load"
)
SPRING = (
    'there are no springs yet; they will be [[loads]] kind = "spring"; until then write constant forces in windows of '
    "the crank angle; several windows approximate a variable force"
)
DAMPER = 'there are no dampers yet; they will be [[loads]] kind = "damper"; until then delete it'
TABLE = (
    'a table of forces or torques is a load: write it under [[loads]] with kind = "table", and `angles` (or `over` and '
    "`positions`) with `values`"
)
GAS = (
    'gas on a piston is a load: write it under [[loads]] with kind = "gas", `bore` and `head`, and an indicator '
    "diagram or the pressures of a compressor"
)
FRICTION = (
    "there is no friction yet; it will be [friction] for all joints and [joints.B] for one; until then write an "
    "opposing force or torque under [[loads]]"
)
SLIDERS = (
    "a slider is a link without length: the `block` of a group RRP or RPR, or of [[slots]] in a scene with a [drive]"
)
ABSENT = (
    Absent("torque power motor torque_curve torque_speed", "drive", MOTOR),
    Absent("power torque motor", "groups", MOTOR),
    Absent("motor motor_torque motor_power drive_torque driving_torque input_torque", "*", MOTOR),
    Absent("motors drives inputs actuator actuators drivers engines input_links", "", ONE_DRIVE),
    Absent("kinematic_chains", "", ONE_DRIVE),
    Absent("spring springs torsion_spring", "*", SPRING),
    Absent("stiffness preload free_length spring_constant rate k", "loads links groups drive slots", SPRING),
    Absent("damper dampers damping dashpot dashpots damping_coefficient viscosity", "*", DAMPER),
    Absent("c", "loads", DAMPER),
    Absent("table tables at points curve profile data csv function", "loads", TABLE),
    Absent(
        "angle", "loads",
        'the components of a force give its direction, force = ["1 kN", "0 N"]; with opposing = true the force acts '
        "against the motion",
    ),
    Absent("gas pressure cylinder_pressure indicator_diagram", "loads", GAS),
    Absent("gas pressure cylinders engine combustion", "", GAS),
    Absent("friction mu friction_coefficient coulomb efficiency losses lubrication bearings", "*", FRICTION),
    Absent(
        "joints pins revolutes revolute_joints hinges", "",
        "a pin is a point that two links name in their `pins`, a point under [fixed] is a pin on the frame, and a "
        "sliding joint is an entry of [[slots]]; there is no list of joints",
    ),
    Absent("crank coupler rocker", "", "write it as a link, e.g. [links.crank]"),
    Absent("sliders slider pistons prismatic prismatic_joints guides", "", SLIDERS),
    Absent("slider sliding type", "links", SLIDERS),
    Absent(
        "engine_layout cylinders_layout firing_order", "",
        "there are no engine layouts yet; they will be [engine_layout]; until then write every crank pin, rod and "
        "piston as links",
    ),
    Absent(
        "cam cams followers follower", "*",
        "there are no cams; prescribe a motion by the `law` of the drive, e.g. a spline with `angles` and `values`",
    ),
    Absent(
        "contact contacts collision clearance clearances backlash play", "*",
        "there is no contact and no clearance: joints are ideal, and links may pass through each other; delete it",
    ),
    Absent(
        "flexible elastic elasticity youngs_modulus e_modulus compliance", "*",
        "links are rigid, and there are no elastic parts; delete it",
    ),
    Absent(
        "thickness width depth height material shape section", "links",
        'a link has no such key; write mass and inertia, mass and uniform = true, or area and density with '
        'mass_properties = "section"',
    ),
    Absent(
        "acceleration angular_acceleration alpha", "*",
        "the motion within the cycle is computed; for forces at a given acceleration run linkjax analyse --at ANGLE "
        "--acceleration VALUE; prescribe a motion by the `law` of the drive",
    ),
    Absent(
        "units unit", "*",
        'write the unit with every quantity, e.g. "300 mm"; --units chooses the units of the printed results',
    ),
    Absent(
        "time dt time_step timestep duration steps simulation solver", "",
        "a whole working cycle is computed, without time steps; `cycle_turns` is its length; --angles is the number of "
        "crank angles in the results",
    ),
)  # fmt: skip
LOAD_KINDS = {  # values of a key `kind` (or `type`) of a load
    "spring": SPRING, "damper": DAMPER, "friction": FRICTION, "motor": MOTOR,
    "force": "delete it: a load with `force` is a force", "torque": "delete it: a load with `torque` is a torque",
}  # fmt: skip
SHAPES = {  # values of known keys in the form of other programs: (table, key, type) -> message
    ("", "drive", list): ONE_DRIVE, ("drive", "link", list): ONE_DRIVE,
    ("loads", "force", dict): TABLE, ("loads", "torque", dict): TABLE, ("loads", "torque", list): TABLE,
    ("", "speed", dict): "speed is one number; prescribe a motion by the `law` of the drive",
}  # fmt: skip


def absent(path: Path, table: Any) -> str:
    """The message about an unknown key or its value; "" where there is none."""
    key, at = plain(path[-1]), str(path[0]) if len(path) > 1 else ""
    held = lookup(table, path[:-1])
    kind = held.get("kind", held.get("type")) if isinstance(held, dict) and at == "loads" else None
    if isinstance(kind, str) and plain(kind) in LOAD_KINDS:
        return LOAD_KINDS[plain(kind)]
    rows = (row for row in ABSENT if key in row.words.split() and {at, "*"} & set(row.tables.split() or [""]))
    return next((row.says for row in rows), "")


def misshapen(path: Path, given: Any) -> str:
    """The message about a list or table where the key takes neither; "" where there is none."""
    key, at = str(path[-1]), str(path[0]) if len(path) > 1 else ""
    return SHAPES.get((at, key, type(given)), "")


def meant(word: object, keys: list[str]) -> str:
    """The one of these keys that a word of another program means; "" where there is none."""
    return next((key for key, words in MEANT.items() if key in keys and plain(word) in words.split()), "")


def plain(word: object) -> str:
    """A word as it is spelt in the lists above."""
    return str(word).strip().lower().replace("-", "_").replace(" ", "_")
