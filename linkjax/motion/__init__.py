"""Motion of the crank over the cycle: the steady state by quadrature, any motion by diffrax."""

from linkjax._renamed import old_names as old_names
from linkjax.motion._by_speed import at_speed as at_speed
from linkjax.motion._diffrax import Run as Run
from linkjax.motion._diffrax import run_in_angle as run_in_angle
from linkjax.motion._in_time import run_in_time as run_in_time
from linkjax.motion._in_time import way_of as way_of
from linkjax.motion._diffrax import steady_by_diffrax as steady_by_diffrax
from linkjax.motion._flow import LEAST as LEAST
from linkjax.motion._flow import Primitive as Primitive
from linkjax.motion._flow import primitive as primitive
from linkjax.motion._flywheel import flywheel_for as flywheel_for
from linkjax.motion._flywheel import flywheel_on as flywheel_on
from linkjax.motion._flywheel import textbook_flywheel as textbook_flywheel
from linkjax.motion._flywheel import with_flywheel as with_flywheel
from linkjax.motion._grid import Grid as Grid
from linkjax.motion._grid import Place as Place
from linkjax.motion._grid import grid_of as grid_of
from linkjax.motion._grid import make_grid as make_grid
from linkjax.motion._nodes import AtNodes as AtNodes
from linkjax.motion._nodes import at_nodes as at_nodes
from linkjax.motion._nodes import node_values as node_values
from linkjax.motion._peaks import TIED as TIED
from linkjax.motion._peaks import Peak as Peak
from linkjax.motion._peaks import by_node as by_node
from linkjax.motion._peaks import peaks as peaks
from linkjax.motion._regime import At as At
from linkjax.motion._regime import Components as Components
from linkjax.motion._regime import Regime as Regime
from linkjax.motion._regime import crank_at as crank_at
from linkjax.motion._rows import Rows as Rows
from linkjax.motion._rows import Summits as Summits
from linkjax.motion._rows import Wanted as Wanted
from linkjax.motion._rows import every_row as every_row
from linkjax.motion._march import Course as Course
from linkjax.motion._march import Way as Way
from linkjax.motion._march import march as march
from linkjax.motion._stiff import is_stiff as is_stiff
from linkjax.motion._stiff import solver_for as solver_for
from linkjax.motion._steady import Steady as Steady
from linkjax.motion._steady import all_loads as all_loads
from linkjax.motion._steady import begin as begin
from linkjax.motion._steady import steady_motion as steady_motion
from linkjax.motion._steady import steady_on as steady_on
from linkjax.motion._windows import at_crank_angles as at_crank_angles

__getattr__ = old_names(__name__)
