"""Closed chains of rolling bodies between two rings: equal bodies, or unequal bodies between eccentric rings."""

from linkjax.rolling._chain import Chain as Chain
from linkjax.rolling._chain import Ellipse as Ellipse
from linkjax.rolling._chain import Rings as Rings
from linkjax.rolling._chain import centre_curve as centre_curve
from linkjax.rolling._chain import chain as chain
from linkjax.rolling._chain import clearances as clearances
from linkjax.rolling._chain import closing_clearance as closing_clearance
from linkjax.rolling._chain import closure_gap as closure_gap
from linkjax.rolling._chain import moved as moved
from linkjax.rolling._chain import ring_points as ring_points
from linkjax.rolling._chain import surface_points as surface_points
from linkjax.rolling._closing import Margins as Margins
from linkjax.rolling._closing import closing_eccentricity as closing_eccentricity
from linkjax.rolling._closing import closing_inner_radius as closing_inner_radius
from linkjax.rolling._closing import closing_outer_radius as closing_outer_radius
from linkjax.rolling._closing import fitting_bodies as fitting_bodies
from linkjax.rolling._closing import margins as margins
from linkjax.rolling._closing import rings_for as rings_for
from linkjax.rolling._design import Rolling as Rolling
from linkjax.rolling._document import document as document
from linkjax.rolling._document import tidy as tidy
from linkjax.rolling._machine import MEMBERS as MEMBERS
from linkjax.rolling._machine import RollingMachine as RollingMachine
from linkjax.rolling._machine import check as check
from linkjax.rolling._rates import Rates as Rates
from linkjax.rolling._rates import rates as rates
