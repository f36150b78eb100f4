"""Pose, kinematic coefficients, margins and dead centres of a mechanism."""

from linkjax._renamed import old_names as old_names
from linkjax._search import Motion as Motion
from linkjax._search import Reversals as Reversals
from linkjax.kinematics._assembly_modes import AssemblyModes as AssemblyModes
from linkjax.kinematics._assembly_modes import assembly_modes as assembly_modes
from linkjax.kinematics._cycle import Least as Least
from linkjax.kinematics._cycle import assembly_margins as assembly_margins
from linkjax.kinematics._cycle import dead_centres as dead_centres
from linkjax.kinematics._cycle import find_dead_centres as find_dead_centres
from linkjax.kinematics._cycle import find_margins as find_margins
from linkjax.kinematics._cycle import find_strokes as find_strokes
from linkjax.kinematics._cycle import min_margin as min_margin
from linkjax.kinematics._cycle import stopping_ends as stopping_ends
from linkjax.kinematics._cycle import strokes as strokes
from linkjax.kinematics._pose import Pose as Pose
from linkjax.kinematics._pose import Prepared as Prepared
from linkjax.kinematics._pose import margins as margins
from linkjax.kinematics._pose import margins_of_pose as margins_of_pose
from linkjax.kinematics._pose import named_groups as named_groups
from linkjax.kinematics._pose import plain as plain
from linkjax.kinematics._pose import pose as pose
from linkjax.kinematics._pose import prepared as prepared
from linkjax.kinematics._pose import transmission_angles as transmission_angles
from linkjax.kinematics._pose import transmission_of_pose as transmission_of_pose
from linkjax.kinematics._ranges import CrankRange as CrankRange
from linkjax.kinematics._ranges import crank_ranges as crank_ranges
from linkjax.kinematics._shortfall import OPEN as OPEN
from linkjax.kinematics._shortfall import not_assembled_at_start as not_assembled_at_start
from linkjax.kinematics._shortfall import open_at_start as open_at_start
from linkjax.kinematics._shortfall import shortfall as shortfall

__getattr__ = old_names(__name__)
