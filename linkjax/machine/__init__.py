"""The scene: mechanism, loads, gravity and mean speed."""

from linkjax.machine._names import CHOICES as CHOICES
from linkjax.machine._names import Names as Names
from linkjax.machine._names import nameless as nameless
from linkjax.machine._scene import ReadyScene as ReadyScene
from linkjax.machine._scene import Scene as Scene
from linkjax.machine._scene import check_scene as check_scene
from linkjax.machine._scene import ready as ready
from linkjax.machine._scene import untitled as untitled
from linkjax.machine._text import PERMANENT as PERMANENT
from linkjax.machine._text import friction_text as friction_text
from linkjax.machine._text import load_place as load_place
from linkjax.machine._text import load_size as load_size
from linkjax.machine._text import motor_text as motor_text
from linkjax.machine._text import passage_text as passage_text
from linkjax.machine._text import speed_text as speed_text
from linkjax.machine._text import when_text as when_text
