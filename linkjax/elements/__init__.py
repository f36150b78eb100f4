"""Elements with friction in closed form: slider, incline, screw, wedge press, gripping cam, journal, thrust ring."""

from linkjax.elements._equivalent import BEARINGS as BEARINGS
from linkjax.elements._equivalent import MATERIALS as MATERIALS
from linkjax.elements._equivalent import groove_friction as groove_friction
from linkjax.elements._equivalent import journal_friction as journal_friction
from linkjax.elements._equivalent import material_friction as material_friction
from linkjax.elements._equivalent import seat_friction as seat_friction
from linkjax.elements._named import NAMED as NAMED
from linkjax.elements._named import element_document as element_document
from linkjax.elements._sliding import incline as incline
from linkjax.elements._sliding import screw as screw
from linkjax.elements._sliding import slider as slider
from linkjax.elements._sliding import wedge_press as wedge_press
from linkjax.elements._turning import Journal as Journal
from linkjax.elements._turning import ThrustRing as ThrustRing
from linkjax.elements._turning import gripping_cam as gripping_cam
from linkjax.elements._turning import journal as journal
from linkjax.elements._turning import thrust_ring as thrust_ring
from linkjax.elements._way import Element as Element
from linkjax.elements._way import Way as Way
