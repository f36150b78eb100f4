"""Numbers a designer asks for: functions of a scene with a unit."""

from linkjax.measures._forces import both_motions as both_motions
from linkjax.measures._forces import peak_names as peak_names
from linkjax.measures._forces import reaction_names as reaction_names
from linkjax.measures._forces import table as table
from linkjax.measures._measures import MEASURES as MEASURES
from linkjax.measures._measures import Measure as Measure
from linkjax.measures._measures import delta as delta
from linkjax.measures._measures import evaluate as evaluate
from linkjax.measures._measures import flywheel_for_target_delta as flywheel_for_target_delta
from linkjax.measures._measures import largest_speed as largest_speed
from linkjax.measures._measures import least_inertia as least_inertia
from linkjax.measures._measures import mean_drive_torque as mean_drive_torque
from linkjax.measures._measures import measure as measure
from linkjax.measures._measures import peak as peak
from linkjax.measures._measures import peak_drive_torque_constant_speed as peak_drive_torque_constant_speed
from linkjax.measures._measures import peak_reaction as peak_reaction
from linkjax.measures._measures import peak_reaction_constant_speed as peak_reaction_constant_speed
from linkjax.measures._measures import peak_shaking_force as peak_shaking_force
from linkjax.measures._measures import peak_shaking_force_constant_speed as peak_shaking_force_constant_speed
from linkjax.measures._measures import regime_margin as regime_margin
from linkjax.measures._measures import rms_shaking_force_constant_speed as rms_shaking_force_constant_speed
from linkjax.measures._measures import smallest_margin as smallest_margin
from linkjax.measures._measures import smallest_speed as smallest_speed
from linkjax.measures._measures import smallest_transmission_angle as smallest_transmission_angle
from linkjax.measures._parts import NODES as NODES
from linkjax.measures._parts import Parts as Parts
