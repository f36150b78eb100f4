"""The gallery and the pictures of the documentation.

Run: python docs/pictures.py FOLDER      (`make pictures` for this folder, `make docs` for the site)
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sketches import sketches

import linkjax as lj
from linkjax._display import Numbers
from linkjax.cli._write import draw
from linkjax.scenes import build, load_rolling, read_document, rolling_names

HERE = Path(__file__).parent
SCENES = HERE.parent / "linkjax/scenes"
HEAD = """# Gallery

Every built-in machine, drawn by `linkjax show NAME --out picture.svg`. `linkjax analyse NAME` analyses it, and
`linkjax new MINE --like NAME` writes its file to start from.
"""
PURPOSES = {
    "presses": "punch-press two-slider-press toggle-press geared-press kozhevnikov-press hay-press hay-press-slider "
               "press-with-motor press-with-friction",
    "pumps and compressors": "slider-crank pump-with-motor oscillating-cylinder scotch-yoke two-cylinder",
    "harvesters, tools, lifts and doors":
        "combine-cutter combine-shoe quick-return toggle-clamp scissor-lift spring-door",
    "examples of a kind of linkage": "four-bar stephenson-3 elliptic-trammel friction-slider-crank andrews-squeezer",
    "rolling bodies": "rolling-eccentric rolling-prototype",
}  # fmt: skip


def about(name: str) -> str:
    """The first sentence of the comment at the top of a scene file."""
    folder = SCENES / ("rolling" if name in rolling_names() else "builtin")
    lines = (folder / f"{name}.toml").read_text(encoding="utf-8").split("\n")
    comment = [line.removeprefix("#").strip() for line in lines[: next(i for i, x in enumerate(lines) if x[:1] != "#")]]
    return re.split(r"(?<=\.) (?=[A-Z])", " ".join(comment))[0]


def gallery() -> str:
    """The page with all machines."""
    every, titles = (*lj.scene_names(), *rolling_names()), {}
    assert sorted(every) == sorted(" ".join(PURPOSES.values()).split()), "a machine has no purpose, or two"
    parts: list[str] = []
    for name in every:
        rolling = name in rolling_names()
        title = (load_rolling(name) if rolling else lj.load(name)).title
        titles[name] = title
        link = f"../linkjax/scenes/{'rolling' if rolling else 'builtin'}/{name}.toml"
        parts.append(f"## {title}\n\n[`{name}`]({link}): {about(name)}\n\n![{title}](images/gallery/{name}.svg)\n")
    lines = [
        f"* {purpose}: {', '.join(f'[{titles[name]}](#{anchor(titles[name])})' for name in names.split())}"
        for purpose, names in PURPOSES.items()
    ]
    return "\n".join([HEAD, "\n".join(lines), "", *parts])


def anchor(title: str) -> str:
    """The anchor of a heading."""
    return re.sub(r"[^\w -]", "", title.lower()).strip().replace(" ", "-")


def machine_of(page: str, name: str) -> lj.Scene:
    """The scene file `name` that a page shows."""
    text = (HERE / page).read_text(encoding="utf-8")
    found = re.search(rf"^```toml\n# {re.escape(name)}\n(.*?)^```", text, re.M | re.S)
    assert found, f"{page} does not show {name}"
    return build(read_document(found[1], name))


def write(folder: Path) -> None:
    """Write the gallery and all pictures below a folder."""
    for kind in ("gallery", "groups"):
        (folder / "images" / kind).mkdir(parents=True, exist_ok=True)
    (folder / "gallery.md").write_text(gallery(), encoding="utf-8")
    machines = {f"gallery/{name}": lj.load(name) for name in lj.scene_names()}
    machines |= {f"gallery/{name}": load_rolling(name) for name in rolling_names()}
    machines["first-machine"] = machine_of("first-machine.md", "pump.toml")
    machines["describe"] = machine_of("describe.md", "joints.toml")
    for name, machine in machines.items():
        draw(machine, "Machine", folder / f"images/{name}.svg", [], Numbers())
    drawings = sketches()
    for name, text in drawings.items():
        (folder / f"images/{name}.svg").write_text(text, encoding="utf-8")
    for name in (*machines, *drawings):
        path = folder / f"images/{name}.svg"
        text = re.sub(r"(\d\.\d\d)\d+", r"\1", path.read_text(encoding="utf-8"))
        path.write_text(text, encoding="utf-8")  # hundredths of a point: small files


if __name__ == "__main__":
    lj.enable_x64()
    write(Path(sys.argv[1]))
