"""Links and their composition: plain data, no mechanics."""

from linkjax.mechanism._link import OF_LENGTH as OF_LENGTH
from linkjax.mechanism._link import Body as Body
from linkjax.mechanism._link import Counterweight as Counterweight
from linkjax.mechanism._link import Flywheel as Flywheel
from linkjax.mechanism._link import Link as Link
from linkjax.mechanism._link import Lump as Lump
from linkjax.mechanism._link import lumps as lumps
from linkjax.mechanism._linkage import linkage as linkage
from linkjax.mechanism._mechanism import Mechanism as Mechanism
from linkjax.mechanism._mechanism import StructureError as StructureError
from linkjax.mechanism._mechanism import links_of as links_of
from linkjax.mechanism._mechanism import structure as structure
