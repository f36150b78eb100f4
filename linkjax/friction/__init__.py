"""Friction in the joints of a machine."""

from linkjax.friction._friction import AbstractFriction as AbstractFriction
from linkjax.friction._friction import GuideFriction as GuideFriction
from linkjax.friction._friction import MeshFriction as MeshFriction
from linkjax.friction._friction import PinFriction as PinFriction
from linkjax.friction._friction import Thrust as Thrust
from linkjax.friction._friction import check_friction as check_friction
from linkjax.friction._friction import everywhere as everywhere
from linkjax.friction._friction import friction_joints as friction_joints
from linkjax.friction._friction import joint_kind as joint_kind
from linkjax.friction._friction import mesh_friction as mesh_friction
from linkjax.friction._indeterminate import indeterminate as indeterminate
from linkjax.friction._rubbing import Rubbing as Rubbing
from linkjax.friction._rubbing import motions as motions
from linkjax.friction._rubbing import pairs as pairs
from linkjax.friction._rubbing import reversing as reversing
from linkjax.friction._rubbing import rubbing as rubbing
