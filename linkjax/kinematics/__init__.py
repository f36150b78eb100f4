"""Pose, kinematic coefficients, margins and dead centres of a mechanism."""

from linkjax.kinematics._pose import Pose as Pose
from linkjax.kinematics._pose import margins as margins
from linkjax.kinematics._pose import named_groups as named_groups
from linkjax.kinematics._pose import pose as pose
from linkjax.kinematics._pose import transmission_angles as transmission_angles
