"""linkjax: design of planar machines with JAX.

A machine is a pytree of design numbers, its whole working cycle a pure function of them, and gradients through that
cycle are exact. Names resolve on first use, so that `import linkjax` costs next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from linkjax._config import enable_x64 as enable_x64
    from linkjax._config import use_cpu_devices as use_cpu_devices
    from linkjax._population import map_designs as map_designs
    from linkjax._results import MachineError as MachineError
    from linkjax._results import Result as Result
    from linkjax._vec import Vec as Vec
    from linkjax.analysis import Cycle as Cycle
    from linkjax.analysis import analyse as analyse
    from linkjax.analysis import analyze as analyze
    from linkjax.analysis import harmonics as harmonics
    from linkjax.design import Case as Case
    from linkjax.design import DesignError as DesignError
    from linkjax.design import Optimum as Optimum
    from linkjax.design import Variable as Variable
    from linkjax.design import at_least as at_least
    from linkjax.design import at_most as at_most
    from linkjax.design import function_error as function_error
    from linkjax.design import optimise as optimise
    from linkjax.design import optimize as optimize
    from linkjax.design import path_error as path_error
    from linkjax.design import position_error as position_error
    from linkjax.design import sum_of_squares as sum_of_squares
    from linkjax.drives import ConstantTorque as ConstantTorque
    from linkjax.drives import DCMotor as DCMotor
    from linkjax.drives import InductionCircuit as InductionCircuit
    from linkjax.drives import InductionMotor as InductionMotor
    from linkjax.drives import LineMotor as LineMotor
    from linkjax.drives import MotorDrive as MotorDrive
    from linkjax.drives import NoMotor as NoMotor
    from linkjax.drives import Servo as Servo
    from linkjax.drives import TableMotor as TableMotor
    from linkjax.drives import Transmission as Transmission
    from linkjax.drives import recommended_delta as recommended_delta
    from linkjax.exchange import from_pylinkage as from_pylinkage
    from linkjax.exchange import read_pylinkage as read_pylinkage
    from linkjax.exchange import to_mjcf as to_mjcf
    from linkjax.exchange import to_pylinkage as to_pylinkage
    from linkjax.friction import GuideFriction as GuideFriction
    from linkjax.friction import MeshFriction as MeshFriction
    from linkjax.friction import PinFriction as PinFriction
    from linkjax.groups import PRP as PRP
    from linkjax.groups import RPP as RPP
    from linkjax.groups import RPR as RPR
    from linkjax.groups import RRP as RRP
    from linkjax.groups import RRR as RRR
    from linkjax.groups import Belt as Belt
    from linkjax.groups import Crank as Crank
    from linkjax.groups import Drive as Drive
    from linkjax.groups import Gear as Gear
    from linkjax.groups import GearPair as GearPair
    from linkjax.groups import General as General
    from linkjax.groups import Guide as Guide
    from linkjax.groups import Harmonic as Harmonic
    from linkjax.groups import LinearDriver as LinearDriver
    from linkjax.groups import Move as Move
    from linkjax.groups import Moves as Moves
    from linkjax.groups import Pinion as Pinion
    from linkjax.groups import Rack as Rack
    from linkjax.groups import RackPair as RackPair
    from linkjax.groups import RedundantLink as RedundantLink
    from linkjax.groups import RedundantSlider as RedundantSlider
    from linkjax.groups import Slot as Slot
    from linkjax.groups import Spline as Spline
    from linkjax.groups import Teeth as Teeth
    from linkjax.kinematics import assembly_modes as assembly_modes
    from linkjax.kinematics import crank_ranges as crank_ranges
    from linkjax.kinematics import dead_centres as dead_centres
    from linkjax.kinematics import margins as margins
    from linkjax.kinematics import pose as pose
    from linkjax.kinematics import strokes as strokes
    from linkjax.kinematics import transmission_angles as transmission_angles
    from linkjax.library import four_bar as four_bar
    from linkjax.library import quick_return as quick_return
    from linkjax.library import scissor_lift as scissor_lift
    from linkjax.library import scotch_yoke as scotch_yoke
    from linkjax.library import six_bar as six_bar
    from linkjax.library import slider_crank as slider_crank
    from linkjax.library import toggle_press as toggle_press
    from linkjax.loads import Coordinate as Coordinate
    from linkjax.loads import Damper as Damper
    from linkjax.loads import Diagram as Diagram
    from linkjax.loads import Drag as Drag
    from linkjax.loads import DragTorque as DragTorque
    from linkjax.loads import Force as Force
    from linkjax.loads import Gas as Gas
    from linkjax.loads import OpposingForce as OpposingForce
    from linkjax.loads import OpposingTorque as OpposingTorque
    from linkjax.loads import Passage as Passage
    from linkjax.loads import Polytropic as Polytropic
    from linkjax.loads import Spring as Spring
    from linkjax.loads import Table as Table
    from linkjax.loads import Torque as Torque
    from linkjax.loads import TorsionDamper as TorsionDamper
    from linkjax.loads import TorsionSpring as TorsionSpring
    from linkjax.loads import Window as Window
    from linkjax.machine import Scene as Scene
    from linkjax.mechanism import Counterweight as Counterweight
    from linkjax.mechanism import Flywheel as Flywheel
    from linkjax.mechanism import Link as Link
    from linkjax.mechanism import Mechanism as Mechanism
    from linkjax.mechanism import StructureError as StructureError
    from linkjax.mechanism import linkage as linkage
    from linkjax.mechanism import structure as structure
    from linkjax.motion import flywheel_for as flywheel_for
    from linkjax.motion import steady_motion as steady_motion
    from linkjax.motion import steady_states as steady_states
    from linkjax.reduction import reduced_mass as reduced_mass
    from linkjax.reduction import reduced_model as reduced_model
    from linkjax.rolling import Rolling as Rolling
    from linkjax.rolling import RollingMachine as RollingMachine
    from linkjax.runs import run as run
    from linkjax.runs import run_up_time as run_up_time
    from linkjax.runs import starting_torque as starting_torque
    from linkjax.scenes import SceneError as SceneError
    from linkjax.scenes import load as load
    from linkjax.scenes import load_problem as load_problem
    from linkjax.scenes import load_rolling as load_rolling
    from linkjax.scenes import rolling_names as rolling_names
    from linkjax.scenes import scene_names as scene_names

__version__ = "0.2.0"

# Every subpackage with the names that the package takes from it; the block above is for type checkers.
_SUBPACKAGES: dict[str, tuple[str, ...]] = {
    "_config": ("enable_x64", "use_cpu_devices"),
    "_population": ("map_designs",),
    "_results": ("MachineError", "Result"),
    "_vec": ("Vec",),
    "groups": (
        "PRP",
        "RedundantSlider",
        "RPP",
        "RPR",
        "RedundantLink",
        "RRP",
        "RRR",
        "Belt",
        "Crank",
        "Drive",
        "Gear",
        "GearPair",
        "General",
        "Guide",
        "Harmonic",
        "Move",
        "Moves",
        "Pinion",
        "Rack",
        "RackPair",
        "LinearDriver",
        "Slot",
        "Spline",
        "Teeth",
    ),
    "elements": (),
    "topology": (),
    "mechanism": ("Counterweight", "Flywheel", "Link", "Mechanism", "StructureError", "linkage", "structure"),
    "kinematics": (
        "assembly_modes",
        "crank_ranges",
        "dead_centres",
        "margins",
        "pose",
        "strokes",
        "transmission_angles",
    ),
    "drives": (
        "ConstantTorque",
        "DCMotor",
        "InductionCircuit",
        "InductionMotor",
        "LineMotor",
        "MotorDrive",
        "NoMotor",
        "Servo",
        "TableMotor",
        "Transmission",
        "recommended_delta",
    ),
    "friction": ("GuideFriction", "MeshFriction", "PinFriction"),
    "loads": (
        "Coordinate",
        "Damper",
        "Diagram",
        "Drag",
        "DragTorque",
        "Force",
        "Gas",
        "OpposingForce",
        "OpposingTorque",
        "Passage",
        "Polytropic",
        "Spring",
        "Table",
        "Torque",
        "TorsionDamper",
        "TorsionSpring",
        "Window",
    ),
    "machine": ("Scene",),
    "library": ("four_bar", "quick_return", "scissor_lift", "scotch_yoke", "six_bar", "slider_crank", "toggle_press"),
    "reduction": ("reduced_mass", "reduced_model"),
    "motion": ("flywheel_for", "steady_motion", "steady_states"),
    "forces": (),
    "sampling": (),
    "analysis": ("Cycle", "analyse", "analyze", "harmonics"),
    "measures": (),
    "rolling": ("Rolling", "RollingMachine"),
    "runs": ("run", "run_up_time", "starting_torque"),
    "exchange": ("from_pylinkage", "read_pylinkage", "to_mjcf", "to_pylinkage"),
    "design": (
        "Case",
        "DesignError",
        "Optimum",
        "Variable",
        "at_least",
        "at_most",
        "function_error",
        "optimise",
        "optimize",
        "path_error",
        "position_error",
        "sum_of_squares",
    ),
    "scenes": ("SceneError", "load", "load_rolling", "load_problem", "rolling_names", "scene_names"),
    "viz": (),
    "report": (),
}
_HOMES = {name: home for home, names in _SUBPACKAGES.items() for name in names}

__all__ = ["__version__", *_HOMES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(import_module(f"linkjax.{_HOMES[name]}"), name)
    elif name in _SUBPACKAGES:
        value = import_module(f"linkjax.{name}")
    else:
        problem = f"module 'linkjax' has no attribute {name!r}"
        raise AttributeError(problem if name.startswith("_") else f"{problem}; {_hint(name)}")
    globals()[name] = value
    return value


def _hint(name: str) -> str:
    """What to write for a name that does not exist."""
    similar = import_module("linkjax._units").similar
    return similar(name, [known for known in __dir__() if not known.startswith("_")]) or "see dir(linkjax)"


def __dir__() -> list[str]:
    return sorted([*__all__, *(each for each in _SUBPACKAGES if not each.startswith("_"))])
