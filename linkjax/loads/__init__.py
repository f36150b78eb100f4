"""Loads on the links."""

from linkjax.loads._dampers import Damper as Damper
from linkjax.loads._dampers import Drag as Drag
from linkjax.loads._dampers import DragTorque as DragTorque
from linkjax.loads._dampers import TorsionDamper as TorsionDamper
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
from linkjax.loads._springs import Spring as Spring
from linkjax.loads._springs import TorsionSpring as TorsionSpring
