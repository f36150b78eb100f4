"""Machines as MuJoCo models.

Source: MuJoCo documentation, XML reference (https://mujoco.readthedocs.io/en/stable/XMLreference.html).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

import numpy as np

from linkjax.exchange._tree import Placed, Stand, Tree, ahead, assembled, plane, stand, tree_of
from linkjax.kinematics import Pose, prepared
from linkjax.machine import Scene, ready
from linkjax.mechanism import Mechanism, StructureError

STEP = 1e-4  # s, time step: half the time constant of the constraints, the largest that MuJoCo allows
STIFF = {"solref": f"{2 * STEP:g} 1", "solimp": "0.9999 0.9999"}
THIN = 0.015  # radius of a drawn link, relative to the greatest distance on a link


def to_mjcf(machine: Mechanism | Scene, phi: float = 0.0, massless: float = 1e-9) -> str:
    """A machine as a MuJoCo model (an MJCF string), in SI units, at the crank angle `phi` (rad).

    Every link is a body in the plane z = 0, with its name and its axes. It is attached to the frame or another link by
    one joint of the same name, a hinge or a slide, whose coordinate (rad or m) is zero at `phi`. Equality constraints
    close the loops: `connect` for pins; `weld` for slides, to a body `<block>.guide` that runs on the guide. Gears in
    mesh have a tendon `<gear>.mesh` of constant length. Every named point is a site of its name on its link; where a
    pin closes a loop, the other link has a site `<link>.<point>` there. The motor `drive` acts on the driving joint, by
    a tendon of the same name if this joint is a pin that closes a loop. A flywheel is the armature of the joint.
    Counterweights are part of their link. A `Scene` sets gravity; working loads, speeds and motion laws are not part of
    the model.

    MuJoCo needs mass and inertia for every body. A link without mass gets `massless` times the greatest mass of a link
    (1 kg if no link has a mass); for its inertia this is multiplied by the square of the greatest distance on a link.
    Constraints are as stiff as MuJoCo allows at a time step of 0.1 ms. Needs MuJoCo 3.3.
    Raises `MachineError` where the machine cannot be assembled at `phi`. Raises `StructureError` for a link whose
    ideal counterweight leaves it without positive inertia, and for machines that are traced or batched.
    """
    if isinstance(machine, Scene):
        if machine.friction:
            problem = "MuJoCo has no friction that follows the reactions of joints"
            raise StructureError("friction", problem, "omit it: dataclasses.replace(scene, friction=())")
        made, gravity, title = ready(machine).mechanism, plane(machine.gravity), machine.title
    else:
        made, gravity, title = prepared(machine), 0j, ""
    mechanism, here = made.mechanism, assembled(made, phi)
    at = stand(mechanism, here)
    tree = tree_of(mechanism, at)
    size = max(abs(place) for link in mechanism.links for place in tree.places[link].values()) or 1.0
    model = ET.Element("mujoco", model=title or mechanism.formula())
    ET.SubElement(model, "compiler", angle="radian", inertiafromgeom="false")
    option = ET.SubElement(model, "option", timestep=f"{STEP:g}", gravity=_numbers(gravity))
    ET.SubElement(option, "flag", contact="disable")
    default = ET.SubElement(model, "default")
    ET.SubElement(default, "equality", STIFF)
    ET.SubElement(default, "geom", contype="0", conaffinity="0", rgba="0.35 0.45 0.65 0.8")
    ET.SubElement(default, "site", size=f"{THIN * size:.3g}", rgba="0.8 0.3 0.2 1")
    bodies = {"frame": ET.SubElement(model, "worldbody")}
    inertials = _inertials(here, tree, massless, size)
    for body in tree.bodies:
        bodies[body.body] = _body(bodies[body.parent], body, inertials[body.body])
        _drawn(bodies[body.body], mechanism, body.body, THIN * size)
    for point, owner in mechanism.owners().items():
        ET.SubElement(bodies[owner], "site", name=point, pos=_numbers(tree.places[owner][point]))
    _close(model, bodies, tree, at, _inertial(0j, massless * _heaviest(here), massless * _heaviest(here) * size**2))
    _couple(model, mechanism, tree)
    _drive(model, mechanism, bodies, tree)
    ET.indent(model)
    return ET.tostring(model, encoding="unicode") + "\n"


def _numbers(at: complex) -> str:
    """A place in the plane, with all digits."""
    return f"{at.real!r} {at.imag!r} 0"


def _turn(u: complex) -> str:
    """A rotation in the plane as a quaternion, for a unit vector."""
    half = 0.5 * float(np.angle(u))
    return f"{np.cos(half).item()!r} 0 0 {np.sin(half).item()!r}"


def _body(parent: ET.Element, placed: Placed, inertial: dict[str, str]) -> ET.Element:
    """A body with its joint."""
    body = ET.SubElement(parent, "body", name=placed.body, pos=_numbers(placed.at), quat=_turn(placed.turned))
    if placed.axis is None:
        ET.SubElement(body, "joint", name=placed.body, type="hinge", axis="0 0 1", pos=_numbers(placed.pin))
    else:
        ET.SubElement(body, "joint", name=placed.body, type="slide", axis=_numbers(placed.axis))
    ET.SubElement(body, "inertial", inertial)
    return body


def _drawn(body: ET.Element, mechanism: Mechanism, link: str, radius: float) -> None:
    """The visible geometry of a link, without mass and contact."""
    length = float(mechanism.links[link].length)
    if length:
        ends = f"0 0 0 {length!r} 0 0"
        ET.SubElement(body, "geom", type="capsule", fromto=ends, size=f"{radius:.3g}")
    else:
        ET.SubElement(body, "geom", type="box", size=f"{2 * radius:.3g} {1.4 * radius:.3g} {radius:.3g}")


def _heaviest(here: Pose) -> float:
    """The greatest mass of a link, 1 kg if no link has a mass."""
    return max(sum(float(lump.mass) for lump in held.values()) for held in here.bodies.values()) or 1.0


def _inertials(here: Pose, tree: Tree, massless: float, size: float) -> dict[str, dict[str, str]]:
    """Mass, mass centre and inertia of every link with its counterweights."""
    least, found = massless * _heaviest(here), {}
    for link, held in here.bodies.items():
        lumps = [(tree.places[link][point], float(lump.mass), float(lump.inertia)) for point, lump in held.items()]
        mass = sum(m for _, m, _ in lumps)
        centre = sum(m * at for at, m, _ in lumps) / mass if mass else next(at for at, _, _ in lumps)
        inertia = sum(own + m * abs(at - centre) ** 2 for at, m, own in lumps)
        if inertia < 0 or (mass == 0 and any(m for _, m, _ in lumps)):
            problem = "its ideal counterweight makes its mass or inertia unphysical (no mass, or an inertia below zero)"
            raise StructureError(f"links.{link}", problem, "omit `ideal`, or give the link more mass")
        found[link] = _inertial(centre, mass or least, inertia or least * size**2)
    return found


def _inertial(centre: complex, mass: float, inertia: float) -> dict[str, str]:
    return {"pos": _numbers(centre), "mass": repr(mass), "diaginertia": " ".join([repr(inertia)] * 3)}


def _close(model: ET.Element, bodies: dict[str, ET.Element], tree: Tree, here: Stand, inertial: dict[str, str]) -> None:
    """Close the loops."""
    equality = ET.SubElement(model, "equality")
    for point, link, by in tree.pins:
        one, two = (_site(bodies[side], side, point, tree) for side in (by, link))
        ET.SubElement(equality, "connect", name=f"{link}.{point}", site1=one, site2=two)
    for joint in tree.slides:
        way, mark = tree.ways[joint.link], f"{joint.link}.guide"
        on = way.base + ahead(joint.link, way, here) * way.along
        _body(bodies[way.on], Placed(mark, way.on, on, way.along, axis=1 + 0j), inertial)
        ET.SubElement(equality, "weld", name=mark, body1=mark, body2=joint.link, relpose="0 0 0 1 0 0 0")


def _couple(model: ET.Element, mechanism: Mechanism, tree: Tree) -> None:
    """Keep gears in mesh, by a tendon whose constant length is their constraint."""
    above = {body.body: body for body in tree.bodies}
    wheels = [wheel for group in mechanism.groups for wheel in group.wheels()]
    names = [joint.name for group in mechanism.groups for joint in group.joints() if joint.meshes]
    for name, wheel in zip(names, wheels, strict=True):
        coupling = wheel.coupling()
        factors = _hinges(coupling.angles, tree)
        for block, factor in coupling.ways.items():
            on = tree.ways[block].on
            ends = [body for body in (block, on) if body in above and above[body].axis is not None]
            hung = [body for body in ends if {body, above[body].parent} == {block, on}]
            joint = hung[0] if hung else f"{block}.guide"
            factors[joint] = factors.get(joint, 0.0) + float(factor)
        _tendon(model, name, factors)
        equality = model.find("equality")
        assert equality is not None
        ET.SubElement(equality, "tendon", name=name, tendon1=name)


def _hinges(angles: Mapping[str, Any], tree: Tree) -> dict[str, float]:
    """Factors of hinge coordinates from factors of link angles: an angle is the sum of all hinges up to the frame."""
    above, factors = {body.body: body for body in tree.bodies}, {}
    for link, factor in angles.items():
        while link != "frame":
            if above[link].axis is None:
                factors[link] = factors.get(link, 0.0) + float(factor)
            link = above[link].parent
    return factors


def _tendon(model: ET.Element, name: str, factors: Mapping[str, float]) -> None:
    """A tendon whose length is the sum of joint coordinates, each times its factor."""
    tendons = model.find("tendon")
    tendon = ET.SubElement(ET.SubElement(model, "tendon") if tendons is None else tendons, "fixed", name=name)
    for joint, factor in factors.items():
        if factor:
            ET.SubElement(tendon, "joint", joint=joint, coef=repr(factor))


def _site(body: ET.Element, link: str, point: str, tree: Tree) -> str:
    """Name of the site of a point on a link; on the link that it belongs to, the name of the point."""
    if any(site.get("name") == point for site in body.findall("site")):
        return point
    ET.SubElement(body, "site", name=f"{link}.{point}", pos=_numbers(tree.places[link][point]))
    return f"{link}.{point}"


def _drive(model: ET.Element, mechanism: Mechanism, bodies: dict[str, ET.Element], tree: Tree) -> None:
    """A motor on the driver, and the flywheel."""
    driver, drive = mechanism.driver, mechanism.driver.as_drive()
    assert drive is not None  # a mechanism has a driver
    motor = ET.SubElement(ET.SubElement(model, "actuator"), "motor", name="drive")
    hung = [body.body for body in tree.bodies if {body.body, body.parent} == {drive.link, drive.on}]
    if not driver.drive_slides() and hung != [drive.link]:  # its pin closes a loop, and is not a joint of the tree
        _tendon(model, "drive", _hinges({drive.link: 1.0, drive.on: -1.0}, tree))
        motor.set("tendon", "drive")
        return
    joint = hung[0] if hung else f"{drive.link}.guide"
    flywheel = float(mechanism.flywheel.inertia)
    if flywheel:
        hinge = bodies[joint].find("joint")
        assert hinge is not None  # only a crank has one
        hinge.set("armature", repr(flywheel))
    motor.set("joint", joint)
