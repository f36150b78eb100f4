"""Loads on the links."""

from linkjax.loads._coordinate import Coordinate as Coordinate
from linkjax.loads._coordinate import Crossings as Crossings
from linkjax.loads._curve import joined_jumps as joined_jumps
from linkjax.loads._gas import ATMOSPHERE as ATMOSPHERE
from linkjax.loads._gas import AbstractPressure as AbstractPressure
from linkjax.loads._gas import Diagram as Diagram
from linkjax.loads._gas import Gas as Gas
from linkjax.loads._gas import Polytropic as Polytropic
from linkjax.loads._loads import AbstractLoad as AbstractLoad
from linkjax.loads._loads import Applied as Applied
from linkjax.loads._loads import Force as Force
from linkjax.loads._loads import Instant as Instant
from linkjax.loads._loads import OpposingForce as OpposingForce
from linkjax.loads._loads import OpposingTorque as OpposingTorque
from linkjax.loads._loads import Torque as Torque
from linkjax.loads._loads import Window as Window
from linkjax.loads._loads import power as power
from linkjax.loads._passage import STILL as STILL
from linkjax.loads._passage import Passage as Passage
from linkjax.loads._passage import Watched as Watched
from linkjax.loads._passage import watched as watched
from linkjax.loads._table import Table as Table
