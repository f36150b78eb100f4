"""A release candidate: version, contents and metadata of its files, and the tutorial with the installed wheel alone.

Run: make release      python tests/release.py FOLDER PYTHON ...

The tutorial is run as a user would: every file, command and Python block of `docs/first-machine.md`, one after the
other, by each Python in an empty environment with the wheel and its dependencies, outside of the repository.
"""

from __future__ import annotations

import email
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/first-machine.md"
ALONE = {"LINKJAX_CACHE": "off", "MPLBACKEND": "agg", "PYTHONNOUSERSITE": "1"}


def checked(wheel: Path, source: Path) -> None:
    """Raise AssertionError where name, version, metadata or contents are not as wanted."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    with zipfile.ZipFile(wheel) as file:
        names = file.namelist()
        (about,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        told = email.message_from_bytes(file.read(about))
    version = told["Version"]
    changes = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert changes[0].rstrip(",") == version, f"CHANGELOG.md begins with {changes[0]}, but the version is {version}"
    assert wheel.name.startswith(f"linkjax-{version}-") and source.name == f"linkjax-{version}.tar.gz"
    assert told["License-Expression"] == project["license"] and told["Requires-Python"] == project["requires-python"]
    assert told["Description-Content-Type"].startswith("text/markdown") and "# linkjax" in told.get_payload()
    assert "linkjax/py.typed" in names and all(name.startswith(("linkjax/", "linkjax-")) for name in names)
    with tarfile.open(source) as file:
        found = {name.split("/")[1] for name in file.getnames() if "/" in name}
    assert {"linkjax", "tests", "docs", "README.md", "LICENSE", "CHANGELOG.md", "pyproject.toml"} <= found


def tutorial(python: str, folder: Path) -> None:
    """Run the tutorial by an interpreter in a folder; raises CalledProcessError where a step fails."""
    bin_folder = Path(python).parent
    env = {**os.environ, **ALONE, "PATH": f"{bin_folder}{os.pathsep}{os.environ['PATH']}"}
    env.pop("PYTHONPATH", None)
    program = ""
    for language, block in re.findall(r"^```(\w+)\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S):
        if language == "toml" and (found := re.match(r"# (added to )?(\S+\.toml)\n", block)):
            with (folder / found[2]).open("a" if found[1] else "w", encoding="utf-8") as file:
                file.write(block.removeprefix(found[0]))
        for line in block.split("\n") if language == "console" else []:
            if line.startswith("$ linkjax "):
                subprocess.run(line[2:].split("  #")[0], shell=True, check=True, cwd=folder, env=env, stdout=sys.stderr)
        program += block if language == "python" else ""
    (folder / "tutorial.py").write_text(program, encoding="utf-8")
    subprocess.run([python, "tutorial.py"], check=True, cwd=folder, env=env, stdout=sys.stderr)


def main(files: Path, pythons: list[str]) -> None:
    """Check the files, and run the tutorial by every interpreter."""
    (wheel,), (source,) = files.glob("*.whl"), files.glob("*.tar.gz")
    checked(wheel, source)
    print(f"{wheel.name}, {source.name}: metadata and contents as wanted", flush=True)
    for python in pythons:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            subprocess.run([python, "-m", "venv", folder / "env"], check=True)
            own = str(folder / "env/bin/python")
            quiet = ["--quiet", "--disable-pip-version-check"]
            subprocess.run([own, "-m", "pip", "install", *quiet, wheel.resolve()], check=True)
            (folder / "work").mkdir()
            tutorial(own, folder / "work")
            version = subprocess.run([own, "--version"], capture_output=True, text=True, check=True).stdout.strip()
            print(f"{version}: the tutorial runs", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
