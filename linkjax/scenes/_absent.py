"""Keys of other programs that scene files do not have, or have under another name, and the messages about them.

Each row of `ABSENT` is one missing feature. When the feature is added, its row is deleted, or those of its words that
have become keys; `tests/scenes/test_absent.py` fails while a row names a key of the format.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from linkjax.scenes._keys import Path

MEANT = {  # words of other programs and textbooks for a key of the same table
    "length": "radius l size",
    "mass": "weight m",
    "inertia": "moment_of_inertia mass_moment_of_inertia moi rotational_inertia izz i_g",
    "centre": "center center_of_mass centre_of_mass mass_center mass_centre centroid cog com cg",
    "points": "markers coupler_points",
    "pins": "joints nodes ends connections vertices",
    "link": "body member part bar",
    "point": "location application_point",
    "kind": "type",
    "to": "other end anchor",
    "stiffness": "spring_constant spring_rate rate k",
    "free_length": "natural_length unstretched_length rest_length unloaded_length initial_length l0",
    "free_angle": "angle natural_angle rest_angle unloaded_angle initial_angle angle0 theta0",
    "preload": "initial_tension initial_force pretension tension",
    "coefficient": "c damping damping_coefficient viscosity",
    "linear": "c1 linear_coefficient",
    "quadratic": "c2 square quadratic_coefficient",
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
    "ratio": "gear_ratio transmission_ratio i",
    "no_load_speed": "free_speed idle_speed no_load",
    "stall_torque": "starting_torque locked_rotor_torque stall",
    "constant": "k torque_constant motor_constant kt ke",
    "resistance": "r armature_resistance",
    "voltage": "u v armature_voltage",
    "breakdown_ratio": "breakdown_torque pull_out_torque max_torque_ratio",
    "starting_ratio": "starting_torque locked_rotor_torque",
    "magnetizing_reactance": "magnetising_reactance xm",
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
    "the motor is a table of its own, [motor], with `kind` (torque, line, table, dc, induction, none) and its `ratio` "
    "to the crank; without it the drive applies the constant torque that balances the cycle, at the mean `speed`"
)
EFFICIENCY = (
    "the efficiency of a gear or belt between motor and crank is `efficiency` under [motor]; friction of joints is "
    "[friction]"
)
ONE_DRIVE = (
    "linkjax has one drive, for machines of one degree of freedom: keep one, and couple other cranks to it by gears; "
    "model a piston that is driven by gas as a load"
)
SPRING = (
    'a spring is a load: write it under [[loads]] with kind = "spring", a torsion spring with kind = "torsion_spring"'
)
DAMPER = (
    'a damper is a load: write it under [[loads]] with kind = "damper", a torsion damper with kind = "torsion_damper"'
)
DRAG = 'the drag of a fluid is a load: write it under [[loads]] with kind = "drag" for a force, or "drag_torque"'
TABLE = (
    'a table of forces or torques is a load: write it under [[loads]] with kind = "table", and `angles` (or `over` and '
    "`positions`) with `values`"
)
GAS = (
    'gas on a piston is a load: write it under [[loads]] with kind = "gas", `bore` and `head`, and an indicator '
    "diagram or the pressures of a compressor"
)
FRICTION = (
    "friction is [friction] for all joints, with coefficient and radius, and [joints.B] for one; the guide of a block "
    'is [joints."slider.guide"]'
)
JOINTS = (
    "a pin is a point that two links name in their `pins`, a point under [fixed] is a pin on the frame, and a sliding "
    "joint is an entry of [[slots]]; [joints.B] holds the friction of one joint"
)
SLIDERS = (
    "a slider is a link without length: the `block` of a group RRP or RPR, or of [[slots]] in a scene with a [drive]"
)
CONTACT = "there is no contact and no clearance, and links may pass through each other; delete it"
ABSENT = (
    Absent("torque power motor torque_curve torque_speed", "drive", MOTOR),
    Absent("power torque motor", "groups", MOTOR),
    Absent("motor", "drive groups links loads", MOTOR),
    Absent("motor_torque motor_power drive_torque driving_torque input_torque", "*", MOTOR),
    Absent("poles number_of_poles", "motor", "write pole_pairs, half the number of poles"),
    Absent("efficiency", "", EFFICIENCY),
    Absent("efficiency", "drive groups links slots loads", EFFICIENCY),
    Absent("motors drives inputs actuator actuators drivers engines input_links", "", ONE_DRIVE),
    Absent("kinematic_chains", "", ONE_DRIVE),
    Absent("spring springs torsion_spring", "*", SPRING),
    Absent("stiffness preload free_length", "links groups drive slots", SPRING),
    Absent("spring_constant spring_rate rate k", "loads links groups drive slots", SPRING),
    Absent("damper dampers damping dashpot dashpots damping_coefficient viscosity", "*", DAMPER),
    Absent("c", "loads", DAMPER),
    Absent("drag drags drag_coefficient drag_torque air_resistance air_drag windage", "*", DRAG),
    Absent("table tables at points curve profile data csv function", "loads", TABLE),
    Absent(
        "angle", "loads",
        'the components of a force give its direction, force = ["1 kN", "0 N"]; with opposing = true the force acts '
        "against the motion",
    ),
    Absent("gas pressure cylinder_pressure indicator_diagram", "loads", GAS),
    Absent("gas pressure cylinders engine combustion", "", GAS),
    Absent("friction", "drive groups links slots loads motor", FRICTION),
    Absent("mu friction_coefficient coulomb losses lubrication bearings", "*", FRICTION),
    Absent("pins revolutes revolute_joints hinges", "", JOINTS),
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
    Absent("contact contacts collision clearances backlash play", "*", CONTACT),
    Absent("clearance", "", CONTACT),
    Absent("clearance", "drive groups links slots", CONTACT),
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
SHAPES = {  # values of known keys in the form of other programs: (table, key, type) -> message
    ("", "joints", list): JOINTS, ("", "drive", list): ONE_DRIVE, ("drive", "link", list): ONE_DRIVE,
    ("loads", "force", dict): TABLE, ("loads", "torque", dict): TABLE, ("loads", "torque", list): TABLE,
    ("", "speed", dict): "speed is one number; prescribe a motion by the `law` of the drive",
}  # fmt: skip


def absent(path: Path) -> str:
    """The message about an unknown key, or about an unknown value as the last step of the path; "" where there is
    none."""
    key, at = plain(path[-1]), str(path[0]) if len(path) > 1 else ""
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
