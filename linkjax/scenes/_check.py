"""Checks across keys: keys that exclude or need each other, lengths that a group needs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from linkjax.mechanism import OF_LENGTH
from linkjax.scenes._explain import fault
from linkjax.scenes._friction import friction_faults
from linkjax.scenes._groups import GroupTable
from linkjax.scenes._guides import Fault
from linkjax.scenes._loads import LoadTable
from linkjax.scenes._models import Counterweight, Link, SceneFile
from linkjax.scenes._passages import passage
from linkjax.scenes._wheels import steep

FORGOTTEN = 100.0  # ratio of sizes: a millimetre read as a metre gives 1000


def check(model: SceneFile, source: str, table: Any) -> None:
    """Raise `SceneError` for the first contradiction between the keys of a scene."""
    for problem in (*_problems(model), *_units_of_sketch(model, table)):
        raise fault(source, table, *problem)


def _problems(model: SceneFile) -> Iterator[Fault]:
    """Every contradiction, as (path, problem, remedy)."""
    yield from _drawn_or_grouped(model)
    yield from _centre_names(model)
    for name, link in model.links.items():
        yield from _link(name, link)
    if model.motor is not None:
        yield from model.motor.faults()
    yield from friction_faults(model.friction, model.joints)
    for number, group in enumerate(model.groups):
        yield from _group(number, group, model)
    for number, load in enumerate(model.loads):
        if load.name == "gravity":
            yield ("loads", number, "name"), "reserved for the weight of the links", "give the load another name"
        for inner, problem, remedy in load.faults():
            yield ("loads", number, *inner), problem, remedy
        yield from _window(number, load, 2 * math.pi * model.cycle_turns)


def _units_of_sketch(model: SceneFile, table: Any) -> Iterator[Fault]:
    """A forgotten unit: of the sketch and the points of the frame, one is in plain numbers (metres), the other has
    units, and the plain one is far larger."""
    sizes, plain = {}, {}
    for key, places in (("fixed", model.fixed), ("sketch", model.sketch)):
        written = [value for name in places for value in table[key][name] if value != 0]
        sizes[key] = max((abs(value) for at in places.values() for value in at), default=0.0)
        plain[key] = {not isinstance(value, str) for value in written}
    if plain["fixed"] | plain["sketch"] != {True, False} or len(plain["fixed"]) != 1 or len(plain["sketch"]) != 1:
        return
    small, large = sorted(sizes.values())
    if sizes["sketch" if plain["sketch"] == {True} else "fixed"] == large > FORGOTTEN * small:
        key = "sketch" if plain["sketch"] == {True} else "fixed"
        problem = f"its plain numbers are metres: its size is {sizes[key]:.4g} m, that of the others {small:.4g} m"
        yield (key,), problem, 'write it in the unit of the other points, e.g. ["30 mm", "40 mm"]'


def _drawn_or_grouped(model: SceneFile) -> Iterator[Fault]:
    """A machine is composed of groups, or drawn by links and joints, not both."""
    if model.drive is None and not model.groups:
        remedy = (
            "add a table [[groups]] for each group, first the crank; or add a table [drive], and pins to every link"
        )
        yield ("groups",), "missing", remedy
    if model.drive is not None:
        if model.groups:
            problem = "a scene has groups, or a drive with links and joints, not both"
            yield ("drive",), problem, "delete drive, or the groups"
        for name, link in model.links.items():
            if not link.pins:
                problem = "missing (a scene with a drive is drawn by links and joints)"
                yield ("links", name, "pins"), problem, 'name the joints of the link, e.g. pins = ["A", "B"]'
            if link.sides and "length" in link.model_fields_set:
                yield ("links", name, "length"), "given, and sides too", "delete length, or sides"
        yield from model.drive.faults(model.slots, model.rotation == "cw")
        for number, slot in enumerate(model.slots):
            yield from slot.guide.faults(("slots", number, "guide"), model.fixed)
        for number, gear in enumerate(model.gears):
            for inner, problem, remedy in gear.mesh_faults():
                yield ("gears", number, *inner), problem, remedy
        for number, rack in enumerate(model.racks):
            for inner, problem, remedy in steep(rack.pressure_angle):
                yield ("racks", number, *inner), problem, remedy
        return
    for key in ("slots", "gears", "racks", "sketch", "branch"):
        if key in model.model_fields_set:
            yield (key,), "has no effect in a scene with groups", f"delete {key}, or write a drive instead of groups"
    for name, link in model.links.items():
        for key in ("pins", "sides"):
            if key in link.model_fields_set:
                yield ("links", name, key), "has no effect in a scene with groups", f"delete {key}"


def _link(name: str, link: Link) -> Iterator[Fault]:
    path = ("links", name)
    for piece, weight in link.counterweights.items():
        yield from _counterweight((*path, "counterweights", piece), weight)
    if name == "frame":
        yield path, 'the name "frame" is reserved for the frame', "give the link another name"
    if link.mass_properties == "section":
        for key in ("area", "density"):
            if getattr(link, key) is None:
                example = '"600 mm^2"' if key == "area" else '"7850 kg/m^3"'
                yield (
                    (*path, key),
                    'missing (mass_properties = "section" computes the mass from it)',
                    f"add {key} = {example}",
                )
        for key in ("mass", "inertia", "centre"):
            if key in link.model_fields_set:
                problem = 'given twice: mass_properties = "section" computes it from area and density'
                yield (*path, key), problem, f"delete {key}, or mass_properties"
    else:
        for key in ("area", "density"):
            if key in link.model_fields_set:
                instead = " instead of uniform" if link.uniform is not False else ""
                yield (*path, key), "has no effect", f'delete {key}, or write mass_properties = "section"{instead}'
    yield from _uniform(path, link)
    if link.reference_length is not None and link.mass_properties not in OF_LENGTH:
        remedy = 'delete it, or write mass_properties = "scaled" or "stretched"'
        yield (*path, "reference_length"), "has no effect", remedy
    if link.reference_length == 0:
        yield (*path, "reference_length"), "must be greater than zero", "write the length that the masses belong to"


def _uniform(path: tuple[str, ...], link: Link) -> Iterator[Fault]:
    """Keys that contradict `uniform`."""
    if link.uniform is False:
        return
    if link.mass_properties == "section":
        yield (*path, "uniform"), 'has no effect: mass_properties = "section" is a uniform bar', "delete uniform"
    if link.mass == 0:
        problem = "must be greater than zero: the link is uniform" if "mass" in link.model_fields_set else "missing"
        yield (*path, "mass"), problem, 'write the mass of the bar or plate, e.g. mass = "5 kg", or delete uniform'
    for key in ("inertia", "centre"):
        if key in link.model_fields_set:
            yield (*path, key), "given twice: uniform computes it from the mass", f"delete {key}, or uniform"
    if link.uniform is True and link.sides:
        corners = ", ".join(f'"{pin}"' for pin in link.pins)
        problem = "a uniform bar has two pins, but this link has sides"
        yield (*path, "uniform"), problem, f"name the corners of the plate, uniform = [{corners}]"


def _counterweight(path: tuple[str, ...], weight: Counterweight) -> Iterator[Fault]:
    for key, other in (("thickness", "density"), ("density", "thickness")):
        if getattr(weight, key) is None and getattr(weight, other) is not None:
            example = '"60 mm"' if key == "thickness" else '"7850 kg/m^3"'
            yield (*path, key), "missing (a disc has thickness and density)", f"add {key} = {example}"
    if weight.inertia is not None and weight.thickness is not None:
        problem = "given twice: a disc's inertia follows from its thickness and density"
        yield (*path, "inertia"), problem, "delete inertia, or thickness and density"
    for key in ("inertia", "thickness", "density"):
        if weight.ideal and getattr(weight, key) is not None:
            yield (*path, key), "has no effect: an ideal counterweight has no inertia", f"delete {key}, or ideal"


def _centre_names(model: SceneFile) -> Iterator[Fault]:
    """Mass centres without a name whose default name S1, S2, … is the name of another point."""
    taken = {*model.fixed, *(pin for group in model.groups for pin in group.pins())}
    taken |= {point for link in model.links.values() for point in (*link.points, *link.counterweights)}
    for number, (name, link) in enumerate(model.links.items(), 1):
        if not link.centre_name and f"S{number}" in taken:
            problem = f"the default name of this mass centre is S{number}, which is also the name of another point"
            yield ("links", name, "centre_name"), problem, f'add centre_name = "C{number}", or rename the other point'


def _group(number: int, group: GroupTable, model: SceneFile) -> Iterator[Fault]:
    path = ("groups", number)
    if group.drives == bool(number):
        problem = "there is more than one driver" if number else "the first group must be the driver"
        one = "keep one: linkjax has one drive, for a mobility of one; a second crank may be coupled to it by gears"
        remedy = one if number else 'begin with kind = "crank" or "linear_driver"'
        yield (*path, "kind"), problem, remedy
    if group.follows() and model.rotation == "cw":
        problem = "the driver follows a law, which gives its sense of motion"
        yield ("rotation",), problem, "delete rotation"
    if group.drives and not group.has_shaft and model.flywheel.inertia > 0:
        yield ("flywheel",), "there is no shaft for it: the driver is a slider", "delete it"
    for name in group.bars():
        if name in model.links and model.links[name].length == 0:
            missing = "length" not in model.links[name].model_fields_set
            problem = f"{'missing' if missing else 'zero'}, but groups[{number}] needs a bar with two pins"
            yield ("links", name, "length"), problem, 'add the distance between its pins, e.g. length = "300 mm"'
    for name in group.sliding():
        if name in model.links and model.links[name].length > 0:
            problem = f"a length, but this link is the slider (block) of groups[{number}]"
            yield ("links", name, "length"), problem, "delete it: a slider has one pin only"
        if name in model.links and model.links[name].mass_properties != "fixed":
            problem = "a slider has no length to which its mass could be scaled"
            yield ("links", name, "mass_properties"), problem, 'delete it: a slider is always "fixed"'
    for inner, problem, remedy in group.faults(model.fixed):
        yield (*path, *inner), problem, remedy


def _window(number: int, load: LoadTable, cycle: float) -> Iterator[Fault]:
    if load.window is None:
        return
    path, turn = ("loads", number, "window"), math.degrees(cycle)
    if not isinstance(load.window, tuple):
        try:
            passage(load.window)
        except ValueError as error:
            problem, _, remedy = str(error).partition("; ")
            yield path, problem, remedy
        return
    on, off = load.window
    if abs(math.remainder(off - on, cycle)) < 1e-9 * cycle:
        problem = f"window start and end coincide (the cycle is {turn:.12g} deg long)"
        yield path, problem, "omit `window` for a permanent load, or move one end"
    elif abs(off - on) > cycle:
        problem = f"longer than the cycle of {turn:.12g} deg"
        yield path, problem, "write [on, off] within one cycle; off may be less than on"
