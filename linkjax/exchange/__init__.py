"""Import and export of machines: MuJoCo models and pylinkage's JSON."""

from linkjax.exchange._from_pylinkage import Imported as Imported
from linkjax.exchange._from_pylinkage import from_pylinkage as from_pylinkage
from linkjax.exchange._from_pylinkage import read_pylinkage as read_pylinkage
from linkjax.exchange._mjcf import to_mjcf as to_mjcf
from linkjax.exchange._to_pylinkage import to_pylinkage as to_pylinkage
