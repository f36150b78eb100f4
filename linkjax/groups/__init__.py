"""Structural groups: the driver and the Assur groups, one file each."""

from linkjax.groups._base import AbstractGroup as AbstractGroup
from linkjax.groups._base import Joint as Joint
from linkjax.groups._base import LinkState as LinkState
from linkjax.groups._base import Margin as Margin
from linkjax.groups._base import PointState as PointState
from linkjax.groups._base import Wrench as Wrench
from linkjax.groups._crank import Crank as Crank
from linkjax.groups._crank import at_rest as at_rest
from linkjax.groups._rpr import RPR as RPR
from linkjax.groups._rrp import RRP as RRP
from linkjax.groups._rrr import RRR as RRR

KINDS = {group.kind: group for group in (Crank, RRR, RRP, RPR)}
