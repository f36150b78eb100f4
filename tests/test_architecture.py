"""The rules of docs/architecture.md that can be checked from outside."""

from __future__ import annotations

import ast
import graphlib
import importlib
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import linkjax
from tests.helpers import PACKAGE, ROOT

RANKS = {
    **dict.fromkeys(
        (
            *(
                "_types",
                "_renamed",
                "_units",
                "_results",
                "_numerics",
                "_interpolate",
                "_lapack",
                "_vec",
                "_compile",
                "_config",
                "_population",
            ),
            *("_batches", "_interpolate", "_search", "_tree"),
            "_display",
        ),
        0,
    ),
    **{
        "groups": 1,
        "elements": 1,
        "topology": 2,
        "mechanism": 3,
        "kinematics": 4,
        "loads": 5,
        "drives": 5,
        "friction": 5,
        "machine": 6,
        "library": 7,
        "reduction": 7,
        "forces": 8,
        "sampling": 9,
        "motion": 10,
    },
    **{"rolling": 11, "runs": 11, "measures": 12, "analysis": 13, "exchange": 13, "design": 14},
    **{"scenes": 15, "viz": 16, "report": 17, "cli": 18, "__main__": 19},
}
ONLY_IN = {"matplotlib": {"viz"}, "typer": {"cli"}, "rich": {"cli"}}  # third-party packages with one home
HEAVY = ("matplotlib", "pint", "typer", "rich", "jinja2", "scipy")  # not needed by calculations
LONGEST_FILE, LONGEST_BODY = 400, 80

FILES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}
ROOMS = {path: tree for path, tree in FILES.items() if path != PACKAGE / "__init__.py"}
CLASSES = {n.name: n for tree in FILES.values() for n in ast.walk(tree) if isinstance(n, ast.ClassDef)}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def dotted(path: Path) -> str:
    """Dotted name of the module in a file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {dotted(path) for path in FILES}


def top(module: str) -> str:
    """First name below the package: `linkjax.motion._grid` is in `motion`."""
    return module.split(".")[1]


def room(module: str) -> str:
    """The subpackage of a module; the files of rank 0 form one."""
    return "base" if RANKS.get(top(module)) == 0 else top(module)


def imports(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Modules that a tree imports, with the line; imports from the package are traced to the file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                yield (inner if inner in MODULES or base == "linkjax" else base), node.lineno


def own_imports(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Imports of the package's own modules."""
    for name, line in imports(tree):
        if name.split(".")[0] in ("linkjax", "") and name != "linkjax.__version__":
            yield name, line


def assert_none(offenders: list[str]) -> None:
    assert not offenders, "\n".join(["", *offenders])


def place(path: Path, line: int = 1) -> str:
    return f"{path.relative_to(ROOT)}:{line}"


def test_every_module_has_a_rank():
    assert {top(dotted(path)) for path in ROOMS} == set(RANKS)


def test_the_documented_ranks_are_these():
    table = re.findall(r"^\| (\d+) \| (.*?) \|", (ROOT / "docs/architecture.md").read_text(encoding="utf-8"), re.M)
    found = {name: int(rank) for rank, names in table for name in re.findall(r"`(\w+)(?:/|\.py)`", names)}
    assert found == {name: rank for name, rank in RANKS.items() if name != "__main__"}


def test_imports_go_down_the_ranks():
    def allowed(source: str, target: str) -> bool:
        if target == "linkjax":  # the package resolves its subpackages on first use; only the top may rely on that
            return top(source) == "cli"
        inside = target in MODULES
        return inside and (room(source) == room(target) or RANKS[top(target)] < RANKS[top(source)])

    wrong = [
        f"{place(path, line)} imports {target}"
        for path, tree in ROOMS.items()
        for target, line in own_imports(tree)
        if not allowed(dotted(path), target)
    ]
    assert_none(wrong)


def test_other_rooms_are_entered_by_the_door():
    wrong = [
        f"{place(path, line)} imports {target}"
        for path, tree in ROOMS.items()
        for target, line in own_imports(tree)
        if target.count(".") > 1 and room(target) != room(dotted(path))
    ]
    assert_none(wrong)


def test_no_cycles_inside_a_room():
    graph = {
        dotted(path): {t for t, _ in own_imports(tree) if t.count(".") and room(t) == room(dotted(path))}
        for path, tree in ROOMS.items()
    }
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, which names the cycle


def test_no_import_of_the_package_is_hidden_in_a_function():
    wrong = []
    for path, tree in ROOMS.items():
        for function in (node for node in ast.walk(tree) if isinstance(node, (*FUNCTIONS, ast.Lambda))):
            wrong += [place(path, line) for _, line in own_imports(function)]
        late = ("importlib", "importlib.import_module", "importlib.util")
        wrong += [place(path, line) for name, line in imports(tree) if name in late]
    assert_none(wrong)


def test_groups_say_themselves_what_others_ask():
    """No other room asks for the class of a group; what follows a reference path still does."""
    kinds = {group.__name__ for group in linkjax.groups.KINDS.values()} | {"General"}
    paths = ("kinematics/_ranges.py", "kinematics/_fold.py", "kinematics/_path.py", "kinematics/_pose.py")
    paths = (*paths, "analysis/_blunt.py", "analysis/_cycle.py")
    calls = (
        (path, node)
        for path, tree in ROOMS.items()
        if room(dotted(path)) != "groups" and not path.as_posix().endswith(paths)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance"
    )
    wrong = [
        place(path, node.lineno) for path, node in calls if kinds & set(re.findall(r"\w+", ast.unparse(node.args[1])))
    ]
    assert_none(wrong)


def test_third_party_packages_have_one_home():
    wrong = [
        f"{place(path, line)} imports {name}"
        for path, tree in ROOMS.items()
        for name, line in imports(tree)
        if room(dotted(path)) not in ONLY_IN.get(name.split(".")[0], {room(dotted(path))})
    ]
    assert_none(wrong)


def test_files_and_functions_are_short():
    long = []
    for path, tree in FILES.items():
        lines = len(path.read_text(encoding="utf-8").splitlines())
        long += [f"{place(path)} has {lines} lines"] if lines > LONGEST_FILE else []
        for node in (node for node in ast.walk(tree) if isinstance(node, FUNCTIONS)):
            body = node.body[1:] if ast.get_docstring(node) and len(node.body) > 1 else node.body
            lines = (body[-1].end_lineno or 0) - body[0].lineno + 1
            long += [f"{place(path, node.lineno)} {node.name} has {lines} lines"] if lines > LONGEST_BODY else []
    assert_none(long)


def test_only_the_command_line_prints():
    wrong = [
        place(path, node.lineno)
        for path, tree in FILES.items()
        if path == PACKAGE / "__init__.py" or room(dotted(path)) != "cli"
        for node in ast.walk(tree)
        if isinstance(node, ast.Name) and node.id == "print"
    ]
    assert_none(wrong)


def test_doors_hold_imports_and_constants_only():
    def plain(node: ast.stmt) -> bool:
        names = [t.id for t in node.targets if isinstance(t, ast.Name)] if isinstance(node, ast.Assign) else []
        if ast.unparse(node) == "__getattr__ = old_names(__name__)":  # messages about names that were renamed
            return True
        text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        return isinstance(node, ast.ImportFrom) or text or (bool(names) and all(n.isupper() for n in names))

    doors = {path: tree for path, tree in ROOMS.items() if path.name == "__init__.py"}
    wrong = [place(path, n.lineno) for path, tree in doors.items() for n in tree.body if not plain(n)]
    unclear = [
        f"{place(path, n.lineno)} {a.name}"
        for path, tree in doors.items()
        for n in tree.body
        if isinstance(n, ast.ImportFrom)
        for a in n.names
        if a.asname != a.name
    ]
    assert_none(wrong)
    assert_none(unclear)  # re-exported as `X as X`


def test_numbers_of_a_design_have_converters():
    """A bare number in a field compiles anew for every design and has no gradient, silently."""
    numeric = re.compile(r"\b(Array|ndarray|Float|Scalar|Angles|Nodes|Panels|float)\b")

    def called(value: ast.expr | None) -> dict[str, str]:
        """Keywords of a call of `field`."""
        if isinstance(value, ast.Call) and ast.unparse(value.func).split(".")[-1] == "field":
            return {k.arg: ast.unparse(k.value) for k in value.keywords if k.arg}
        return {}

    wrong = []
    for path, tree in FILES.items():
        classes = [n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and _is_module(n)]
        for field in (n for c in classes for n in c.body if isinstance(n, ast.AnnAssign)):
            options, annotation = called(field.value), ast.unparse(field.annotation)
            static = options.get("static") == "True" or "ClassVar" in annotation or "AbstractVar" in annotation
            number = bool(numeric.search(annotation))
            bare = "float" in annotation and "converter" not in options
            if number and not static and ((options and "converter" not in options) or bare):
                wrong.append(f"{place(path, field.lineno)} {ast.unparse(field.target)}")
    assert_none(wrong)


def _is_module(node: ast.ClassDef) -> bool:
    """Whether a class is an `equinox.Module`: by its bases, traced by name through the package."""
    bases = {ast.unparse(base) for base in node.bases}
    own = [CLASSES[name] for name in bases & set(CLASSES) - {node.name}]
    return bool(bases & {"eqx.Module", "equinox.Module"}) or any(_is_module(base) for base in own)


def test_public_things_are_documented():
    wrong = [place(path) for path, tree in FILES.items() if tree.body and not ast.get_docstring(tree)]
    for path, tree in FILES.items():
        for node in tree.body:
            if isinstance(node, (*FUNCTIONS, ast.ClassDef)) and not node.name.startswith("_"):
                wrong += [] if ast.get_docstring(node) else [f"{place(path, node.lineno)} {node.name}"]
    assert_none(wrong)


def test_type_checkers_see_the_public_names():
    block = next(n for n in FILES[PACKAGE / "__init__.py"].body if isinstance(n, ast.If))
    seen = {(a.name, n.module) for n in block.body if isinstance(n, ast.ImportFrom) for a in n.names}
    assert seen == {(name, f"linkjax.{home}") for name, home in linkjax._HOMES.items()}


@pytest.mark.parametrize("name", linkjax.__all__)
def test_public_name(name):
    value = getattr(linkjax, name)
    assert name in dir(linkjax)
    assert isinstance(value, str) or value.__doc__


def test_linear_algebra_cannot_block():
    """Batches that jaxlib passes to other threads may wait for ever: see `_lapack`."""
    allowed = {"_lapack.py", "_compile.py"}  # the second only loads the routines
    files = [file for file in PACKAGE.rglob("*.py") if file.name not in allowed]
    assert not [file.name for file in files if re.search(r"\b(jnp|lax|scipy)\.linalg\b", file.read_text("utf-8"))]


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="'linkjax' has no attribute 'cranc'"):
        _ = linkjax.cranc
    assert importlib.import_module("linkjax.groups") is linkjax.groups


def run(*lines: str, **environment: str) -> str:
    """Output of a new Python process."""
    code = "\n".join(lines)
    env = {"PATH": "", "HOME": str(ROOT / ".cache"), **environment}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=env, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_import_is_light_and_changes_nothing():
    offered = [r for r in linkjax._SUBPACKAGES if RANKS[r] <= RANKS["scenes"] and f"linkjax.{r}" in MODULES]
    out = run(
        "import sys, linkjax",
        f"print([m for m in ('jax', 'diffrax', *{HEAVY}) if m in sys.modules])",
        "import jax, importlib",
        "before = dict(jax.config.values)",
        f"for room in {offered}: importlib.import_module('linkjax.' + room)",
        f"print([m for m in {HEAVY} if m in sys.modules])",
        "print(before == dict(jax.config.values), jax._src.xla_bridge.backends_are_initialized())",
    )
    assert out.splitlines() == ["[]", "[]", "True False"]


def test_settings():
    cache = str(ROOT / ".cache" / "settings")
    out = run(
        "import jax, linkjax._config as c, os",
        "c.enable_x64()",
        f"print(c.cache_folder() == c.cache_home(), str(c.cache_home()) == {cache!r} + '/linkjax')",
        "print(c.use_cpu_devices(3), c.use_cpu_devices(5), len(jax.devices()), jax.numpy.ones(()).dtype)",
        XDG_CACHE_HOME=cache,
    )
    assert out.splitlines() == ["True True", "3 3 3 float64"]
    out = run(
        "import linkjax._config as c, pathlib",
        "print(c.cache_folder().name, c.use_cpu_devices())",
        "print(c.cache_home() == pathlib.Path.home() / '.cache' / 'linkjax')",
        JAX_COMPILATION_CACHE_DIR=f"{cache}/chosen",
        JAX_NUM_CPU_DEVICES="4",
        XDG_CACHE_HOME="relative/is/ignored",
    )
    assert out.splitlines() == ["chosen 4", "True"]
    (ROOT / ".cache").mkdir(exist_ok=True)
    (ROOT / ".cache" / "file").touch()
    assert run("import linkjax._config as c; print(c.cache_folder())", XDG_CACHE_HOME=f"{cache}/../file") == "None"


def test_the_wheel_holds_the_package_alone(tmp_path):
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)]
    done = subprocess.run(build, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.startswith(f"linkjax-{linkjax.__version__}-")
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    wanted = {p.relative_to(ROOT).as_posix() for p in PACKAGE.rglob("*") if p.is_file() and p.suffix != ".pyc"}
    assert names == wanted
    assert {"linkjax/py.typed", "linkjax/__init__.py"} <= names


def test_checked_folders_exist():
    """A path that matches nothing would pass silently."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    named = [*settings["pyright"]["include"], *settings["pytest"]["ini_options"]["testpaths"]]
    assert [folder for folder in named if not (ROOT / folder).is_dir()] == []
