"""Reduced inertia and reduced torque."""

from linkjax._renamed import old_names as old_names
from linkjax.reduction._reduction import Moving as Moving
from linkjax.reduction._reduction import Reduced as Reduced
from linkjax.reduction._reduction import by_speed as by_speed
from linkjax.reduction._reduction import loaded as loaded
from linkjax.reduction._reduction import mass_sums as mass_sums
from linkjax.reduction._reduction import of_crank as of_crank
from linkjax.reduction._reduction import reduce_pose as reduce_pose
from linkjax.reduction._reduction import reduced_model as reduced_model
from linkjax.reduction._reduction import shares_at as shares_at
from linkjax.reduction._reduction import unloaded as unloaded
from linkjax.reduction._translating import ReducedMass as ReducedMass
from linkjax.reduction._translating import reduced_mass as reduced_mass

__getattr__ = old_names(__name__)
