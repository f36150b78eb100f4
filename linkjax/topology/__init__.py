"""What follows from the joints of groups: pairs, classes, mobility, structure, and the link of each point."""

from linkjax.topology._class import KINDS_OF_II as KINDS_OF_II
from linkjax.topology._class import class_of as class_of
from linkjax.topology._class import classified as classified
from linkjax.topology._freedom import blocks as blocks
from linkjax.topology._freedom import counted as counted
from linkjax.topology._freedom import freedom as freedom
from linkjax.topology._freedom import shared_forces as shared_forces
from linkjax.topology._pairs import Pair as Pair
from linkjax.topology._pairs import pairs_of as pairs_of
from linkjax.topology._points import origins as origins
from linkjax.topology._points import owners as owners
from linkjax.topology._rates import Lies as Lies
from linkjax.topology._rates import null_space as null_space
from linkjax.topology._rates import place_name as place_name
from linkjax.topology._rates import rates as rates
from linkjax.topology._structure import Part as Part
from linkjax.topology._structure import Structure as Structure
from linkjax.topology._structure import structure_of as structure_of
