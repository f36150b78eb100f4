"""Scene files: TOML with units on values, read into scenes and rolling bodies; the built-in machines."""

from linkjax._renamed import old_names as old_names
from linkjax._units import QuantityError as QuantityError
from linkjax._units import quantity as quantity
from linkjax.scenes._build import build as build
from linkjax.scenes._build import build_problem as build_problem
from linkjax.scenes._build import json_schema as json_schema
from linkjax.scenes._build import load as load
from linkjax.scenes._build import load_problem as load_problem
from linkjax.scenes._build import loads_text as loads_text
from linkjax.scenes._build import starter as starter
from linkjax.scenes._build import starter_like as starter_like
from linkjax.scenes._build_rolling import build_rolling as build_rolling
from linkjax.scenes._build_rolling import load_rolling as load_rolling
from linkjax.scenes._build_rolling import rolling_schema as rolling_schema
from linkjax.scenes._build_rolling import rolling_starter as rolling_starter
from linkjax.scenes._build_rolling import rolling_text as rolling_text
from linkjax.scenes._document import Document as Document
from linkjax.scenes._document import load_document as load_document
from linkjax.scenes._document import overridden as overridden
from linkjax.scenes._document import override as override
from linkjax.scenes._document import read_document as read_document
from linkjax.scenes._document import rolling_names as rolling_names
from linkjax.scenes._document import scene_names as scene_names
from linkjax.scenes._document import setting as setting
from linkjax.scenes._errors import SceneError as SceneError
from linkjax.scenes._joints import sketched_keys as sketched_keys
from linkjax.scenes._write import text_of as text_of

__getattr__ = old_names(__name__)
