"""The JSON Schema for editors: the one in the package is that of the models, and separates good and bad scenes."""

import json
import re
import subprocess
import sys
import tomllib

import jsonschema
import pytest

from linkjax.scenes import json_schema, scene_names, starter
from tests.helpers import PACKAGE, ROOT
from tests.scenes.test_messages import PRESS, edit

SHIPPED = PACKAGE / "scenes/scene.schema.json"
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "studies").rglob("*.md")])
BUILTIN = {name: (PACKAGE / f"scenes/builtin/{name}.toml").read_text(encoding="utf-8") for name in scene_names()}
DOCUMENTED = {
    f"{page.name}, block {number}": block
    for page in PAGES
    for number, block in enumerate(re.findall(r"^```toml\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S))
    if "[[groups]]" in block
}
SCENES = {**BUILTIN, "starter": starter("Pump"), **DOCUMENTED}

BROKEN = {
    "misspelt key": edit('mass = "5 kg"', 'mas = "5 kg"'),
    "misspelt table": edit("[links.crank]", "[link.crank]"),
    "misspelt key of a place": edit("turned =", "turnd ="),
    "misspelt key of a guide": edit('along = "0', 'angle = "0'),
    "misspelt key of [optimise]": edit("minimise =", "minimize ="),
    "key of another kind of group": edit('end = "D"', 'end = "D"\nmeet = "X"'),
    "missing key": edit('speed = "700 rpm"', ""),
    "missing key of a group": edit('pivot = "A"', ""),
    "missing tables": 'speed = "700 rpm"',
    "no kind": edit('kind = "RRP"', ""),
    "unknown kind": edit('kind = "RRP"', 'kind = "RPRP"'),
    "unknown side": edit('side = "left"', 'side = "up"'),
    "unknown mean": f'mean = "middle"\n{PRESS}',
    "truth for a text": edit('title = "Hay press"', "title = true"),
    "truth for a quantity": edit('mass = "5 kg"', "mass = true"),
    "text for a truth": edit("opposing = true", 'opposing = "yes"'),
    "list for a quantity": edit('length = "300 mm"', 'length = ["300 mm"]'),
    "one of two": edit('window = ["90 deg", "335 deg"]', 'window = ["90 deg"]'),
    "an angle without unit": edit('along = "0 deg"', "along = 30"),
    "negative mass": edit('mass = "5 kg"', "mass = -5"),
    "no speed": edit('speed = "700 rpm"', "speed = 0"),
    "half a turn": f"cycle_turns = 0.5\n{PRESS}",
    "a number for the groups": "groups = 3\n" + PRESS.split("[[groups]]")[0],
    "one bound": edit('"0 to 40 kg m^2"', '["0 kg m^2"]'),
    "no starts": edit("starts = 10", "starts = 0"),
}


@pytest.fixture(scope="module")
def validator():
    schema = json.loads(SHIPPED.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_the_shipped_schema_is_that_of_the_models():
    remedy = "out of date: python -m linkjax schema > linkjax/scenes/scene.schema.json"
    assert json.loads(SHIPPED.read_text(encoding="utf-8")) == json.loads(json.dumps(json_schema())), remedy


def test_the_command_prints_the_shipped_file():
    done = subprocess.run([sys.executable, "-m", "linkjax", "schema"], capture_output=True, cwd=ROOT, check=True)
    assert done.stdout.decode("utf-8") == SHIPPED.read_text(encoding="utf-8")


def test_it_has_a_name_but_no_address():
    schema = json_schema()
    assert schema["title"] == "linkjax scene" and schema["$id"] == "linkjax-scene"
    assert schema["$schema"] == jsonschema.Draft202012Validator.META_SCHEMA["$id"]


def test_every_key_is_described():
    schema = json_schema()
    tables = {"": schema, **schema["$defs"]}
    keys = [(name, key, about) for name, table in tables.items() for key, about in table["properties"].items()]
    assert [f"{name}.{key}" for name, key, about in keys if not about.get("description")] == []


@pytest.mark.parametrize("name", SCENES)
def test_scenes_are_valid(name, validator):
    assert [error.message for error in validator.iter_errors(tomllib.loads(SCENES[name]))] == []


def test_scenes_of_the_documentation_are_found():
    assert len(DOCUMENTED) >= 2


@pytest.mark.parametrize("name", BROKEN)
def test_broken_scenes_are_not(name, validator):
    assert not validator.is_valid(tomllib.loads(BROKEN[name]))
