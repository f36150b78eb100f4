"""Measures of a machine: functions of a scene, each with a unit."""

from linkjax._renamed import old_names as old_names
from linkjax.measures._families import FAMILIES as FAMILIES
from linkjax.measures._families import Family as Family
from linkjax.measures._forces import in_motion as in_motion
from linkjax.measures._forces import motion_of as motion_of
from linkjax.measures._forces import peak_names as peak_names
from linkjax.measures._forces import reaction_names as reaction_names
from linkjax.measures._forces import signed_rows as signed_rows
from linkjax.measures._forces import table as table
from linkjax.measures._gaps import no_transmission_angle as no_transmission_angle
from linkjax.measures._measures import delta as delta
from linkjax.measures._measures import flywheel_for_target_delta as flywheel_for_target_delta
from linkjax.measures._measures import max_crank_speed as max_crank_speed
from linkjax.measures._measures import max_drive_torque_constant_speed as max_drive_torque_constant_speed
from linkjax.measures._measures import mean_drive_power as mean_drive_power
from linkjax.measures._measures import mean_drive_torque as mean_drive_torque
from linkjax.measures._measures import min_crank_speed as min_crank_speed
from linkjax.measures._measures import min_drive_torque_constant_speed as min_drive_torque_constant_speed
from linkjax.measures._measures import min_inertia_ratio as min_inertia_ratio
from linkjax.measures._measures import min_margin as min_margin
from linkjax.measures._measures import min_transmission_angle as min_transmission_angle
from linkjax.measures._measures import peak_drive_torque_constant_speed as peak_drive_torque_constant_speed
from linkjax.measures._measures import peak_reaction as peak_reaction
from linkjax.measures._measures import peak_reaction_constant_speed as peak_reaction_constant_speed
from linkjax.measures._measures import peak_shaking_force as peak_shaking_force
from linkjax.measures._measures import peak_shaking_force_constant_speed as peak_shaking_force_constant_speed
from linkjax.measures._measures import peak_shaking_moment_constant_speed as peak_shaking_moment_constant_speed
from linkjax.measures._measures import rms_shaking_force_constant_speed as rms_shaking_force_constant_speed
from linkjax.measures._measures import steady_state_margin as steady_state_margin
from linkjax.measures._parts import NODES as NODES
from linkjax.measures._parts import Parts as Parts
from linkjax.measures._registry import MEASURES as MEASURES
from linkjax.measures._registry import Measure as Measure
from linkjax.measures._registry import evaluate as evaluate
from linkjax.measures._registry import found_by as found_by
from linkjax.measures._registry import measure as measure
from linkjax.measures._registry import measure_names as measure_names
from linkjax.measures._registry import named as named
from linkjax.measures._registry import peak as peak
from linkjax.measures._subgradients import Subgradient as Subgradient
from linkjax.measures._subgradients import subgradients as subgradients

__getattr__ = old_names(__name__)
