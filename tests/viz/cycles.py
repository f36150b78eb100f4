"""Analysed built-in machines that the tests of drawings and reports share."""

from __future__ import annotations

import functools
from typing import Any

import pytest

import linkjax as lj
from linkjax.analysis import document
from linkjax.viz import PICTURES

QUICK = ("hay-press", "quick-return")
SCENES = [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in lj.scene_names()]
OF_MOTORS = ("loop", "harmonics")  # what figures of motors need
STANDARD = tuple(picture for picture in PICTURES if picture.needs not in OF_MOTORS)


@functools.cache
def analysed(name: str) -> tuple[lj.Scene, dict[str, Any]]:
    """A built-in scene and the document of its analysis; not to be changed."""
    scene = lj.load(name)
    return scene, document(lj.analyse(scene), name, lj.__version__)
