"""Reduced inertia and reduced torque."""

from linkjax._renamed import old_names as old_names
from linkjax.reduction._reduction import Reduced as Reduced
from linkjax.reduction._reduction import governing as governing
from linkjax.reduction._reduction import mass_sums as mass_sums
from linkjax.reduction._reduction import reduce_pose as reduce_pose
from linkjax.reduction._reduction import reduced_model as reduced_model

__getattr__ = old_names(__name__)
