"""Motion of the crank over the cycle."""

from linkjax.motion._grid import Grid as Grid
from linkjax.motion._grid import make_grid as make_grid
from linkjax.motion._steady import Steady as Steady
from linkjax.motion._steady import node_values as node_values
from linkjax.motion._steady import steady as steady
from linkjax.motion._steady import steady_on as steady_on
