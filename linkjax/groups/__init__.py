"""Structural groups: the driver and the Assur groups, one file each."""

from linkjax._renamed import old_names as old_names
from linkjax.groups._base import BEYOND as BEYOND
from linkjax.groups._base import AbstractGroup as AbstractGroup
from linkjax.groups._base import Coupling as Coupling
from linkjax.groups._base import Margin as Margin
from linkjax.groups._base import Wrench as Wrench
from linkjax.groups._branch_path import TOUCHING as TOUCHING
from linkjax.groups._branch_path import BranchPath as BranchPath
from linkjax.groups._branch_path import branch_path as branch_path
from linkjax.groups._closure import Found as Found
from linkjax.groups._counted_turns import CountedTurns as CountedTurns
from linkjax.groups._counted_turns import counted_turns as counted_turns
from linkjax.groups._drawn import GearPair as GearPair
from linkjax.groups._drawn import RackPair as RackPair
from linkjax.groups._drive import Drive as Drive
from linkjax.groups._driver import AbstractDriver as AbstractDriver
from linkjax.groups._driver import Crank as Crank
from linkjax.groups._driver import LinearDriver as LinearDriver
from linkjax.groups._followed import Along as Along
from linkjax.groups._followed import Path as Path
from linkjax.groups._followed import followed as followed
from linkjax.groups._gear import Gear as Gear
from linkjax.groups._general import General as General
from linkjax.groups._guide import Guide as Guide
from linkjax.groups._guide import Seen as Seen
from linkjax.groups._guide import Slot as Slot
from linkjax.groups._law import AbstractLaw as AbstractLaw
from linkjax.groups._law import Harmonic as Harmonic
from linkjax.groups._law import Rotation as Rotation
from linkjax.groups._law import Spline as Spline
from linkjax.groups._law_moves import Move as Move
from linkjax.groups._law_moves import Moves as Moves
from linkjax.groups._law_moves import Shape as Shape
from linkjax.groups._lost import Lost as Lost
from linkjax.groups._mesh import PRESSURE as PRESSURE
from linkjax.groups._mesh import Belt as Belt
from linkjax.groups._mesh import Mesh as Mesh
from linkjax.groups._mesh import Teeth as Teeth
from linkjax.groups._pairs import FRAME as FRAME
from linkjax.groups._pairs import Joint as Joint
from linkjax.groups._passive import RedundantLink as RedundantLink
from linkjax.groups._passive import RedundantSlider as RedundantSlider
from linkjax.groups._prp import PRP as PRP
from linkjax.groups._rack import Pinion as Pinion
from linkjax.groups._rack import Rack as Rack
from linkjax.groups._reference_path import Meshing as Meshing
from linkjax.groups._reference_path import ReferencePath as ReferencePath
from linkjax.groups._reference_path import closed_to as closed_to
from linkjax.groups._reference_path import slow as slow
from linkjax.groups._rpp import RPP as RPP
from linkjax.groups._rpr import RPR as RPR
from linkjax.groups._rrp import RRP as RRP
from linkjax.groups._rrr import RRR as RRR
from linkjax.groups._state import LinkState as LinkState
from linkjax.groups._state import PointState as PointState
from linkjax.groups._state import at_rest as at_rest
from linkjax.groups._state import carried as carried

KINDS = {
    group.kind: group
    for group in (Crank, LinearDriver, RRR, RRP, RPR, PRP, RPP, Gear, Rack, Pinion, RedundantLink, RedundantSlider)
}

__getattr__ = old_names(__name__)
