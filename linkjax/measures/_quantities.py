"""The quantities over the crank angle that measures are made of, at many places of the cycle grid at once.

Every quantity is a vector of two parts in the frame, or a number with its sign, for each of several elements.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax._numerics import nearest_turn
from linkjax.forces import Forces, other_sides
from linkjax.groups import FRAME, Guide
from linkjax.kinematics import Pose, named_groups
from linkjax.machine import Scene
from linkjax.measures._driver import asked_of_motor
from linkjax.measures._forces import known_torque
from linkjax.measures._parts import Parts
from linkjax.measures._structure import Elements, by_structure, guided, guides, sliding_points
from linkjax.motion import At, Grid, Place, Regime
from linkjax.reduction import mass_sums

Of = Literal["", "point", "link", "group", "joint"]
Vectors = Float[Array, "elements 2 places"]
ALL = ""  # in the place of an element: all of them


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A quantity over the crank angle in SI `unit`, of a point, link, group or joint, or of the whole machine.

    `vector` says whether it is a vector, whose length counts, or a number with its sign. `moves` says whether it
    depends on the motion, so that there is one at constant speed. `asks` is what the machine must be asked for (see
    `Wanted`). `at(of, elements)` gives the function from regime and places to the vectors, `names(scene)` its elements.
    `motor` says whether it is one of the motor's, `kinks` whether it has a kink where other flanks of gears are loaded,
    `forced` whether there is none where friction locks the machine.
    """

    name: str
    unit: str
    meaning: str
    of: Of
    vector: bool
    moves: bool
    asks: str
    at: Callable[[Parts, Elements], Callable[[Regime, At], Vectors]]
    names: Callable[[Scene], Elements]
    motor: bool = False
    kinks: bool = False
    forced: bool = False

    def lacking(self, scene: Scene) -> tuple[str, str] | None:
        """What a scene lacks for this quantity, and a remedy; None if it has it."""
        return ("the scene has no motor", "add [motor], or delete it") if self.motor and scene.motor is None else None

    def regime(self, of: Parts, motion: bool) -> Regime:
        """The actual motion, or that of constant speed, on a grid whose panels end at the kinks of this quantity."""
        found = of.true_motion if motion else of.constant_speed
        return of.with_kinks(found) if self.kinked(of.scene) else found

    def kinked(self, scene: Scene) -> bool:
        """Whether it has kinks in the motion: with friction, everything that depends on the motion may have."""
        return self.kinks or (self.moves and bool(scene.friction))

    def signed(self, scene: Scene, element: str) -> bool:
        """Whether it is a number with its sign for this element: of a guide the force normal to it."""
        return not self.vector or (self.of == "joint" and element in guided(scene))


QUANTITIES: dict[str, Quantity] = {}


def quantity(
    unit: str, of: Of, *, vector: bool = False, moves: bool = True, asks: str = "pose", names: Any = None,
    motor: bool = False, kinks: bool = False, forced: bool = False,
):  # fmt: skip
    """Make a quantity of a function of `Parts` and elements, and register it under the function's name."""

    def made(function: Callable[[Parts, Elements], Callable[[Regime, At], Vectors]]) -> Quantity:
        meaning = (function.__doc__ or "").strip()
        given = (unit, meaning, of, vector, moves, asks, function, names or NAMES[of], motor, kinks, forced)
        found = Quantity(function.__name__, *given)
        QUANTITIES[found.name] = found
        return found

    return made


@by_structure
def _joint_names(scene: Scene) -> Elements:
    return tuple(f"{joint}.{link}" for joint, sides in other_sides(scene).items() for link in sides)


@by_structure
def _point_names(scene: Scene) -> Elements:
    return tuple(name for name, link in scene.mechanism.owners().items() if link != FRAME)


NAMES: dict[str, Callable[[Scene], Elements]] = {
    "": lambda scene: (),
    "point": _point_names,
    "link": lambda scene: tuple(scene.mechanism.links),
    "group": lambda scene: tuple(named_groups(scene.mechanism)),
    "joint": _joint_names,
}


def _stacked(numbers: list[Array] | Array) -> Vectors:
    """Numbers as vectors of two parts."""
    one = jnp.stack(numbers) if isinstance(numbers, list) else numbers
    return jnp.stack([one, jnp.zeros_like(one)], axis=1)


@compiled_soon(static=("what", "elements"))
def _of_pose(pose: Pose, speed: Array, acceleration: Array, what: str, elements: Elements) -> Vectors:
    points, links = pose.points, pose.links
    if what in ("x", "y"):
        return _stacked([getattr(points[name].r, what) for name in elements])
    if what == "angular_velocity":
        return _stacked([links[name].w * speed for name in elements])
    if what == "angular_acceleration":
        return _stacked([links[name].e * speed**2 + links[name].w * acceleration for name in elements])
    found = [points[name].dr * speed for name in elements]
    if what == "acceleration":
        found = [points[name].ddr * speed**2 + points[name].dr * acceleration for name in elements]
    return jnp.stack([jnp.stack([v.x, v.y]) for v in found])


def _asked_of_pose(what: str, elements: Elements) -> Callable[[Regime, At], Vectors]:
    return lambda regime, at: regime.machine.run(_of_pose, at.pose, *regime.crank(at), what=what, elements=elements)


@quantity("m", "point", moves=False)
def x(of: Parts, elements: Elements):
    """Coordinate x of a point."""
    return _asked_of_pose("x", elements)


@quantity("m", "point", moves=False)
def y(of: Parts, elements: Elements):
    """Coordinate y of a point."""
    return _asked_of_pose("y", elements)


@quantity("m/s", "point", vector=True)
def velocity(of: Parts, elements: Elements):
    """Velocity of a point."""
    return _asked_of_pose("velocity", elements)


@quantity("m/s^2", "point", vector=True)
def acceleration(of: Parts, elements: Elements):
    """Acceleration of a point."""
    return _asked_of_pose("acceleration", elements)


@quantity("rad/s", "link")
def angular_velocity(of: Parts, elements: Elements):
    """Angular velocity of a link (positive counter-clockwise)."""
    return _asked_of_pose("angular_velocity", elements)


@quantity("rad/s^2", "link")
def angular_acceleration(of: Parts, elements: Elements):
    """Angular acceleration of a link (positive counter-clockwise)."""
    return _asked_of_pose("angular_acceleration", elements)


@quantity("rad", "link", moves=False)
def angle(of: Parts, elements: Elements):
    """Angle of a link from the x axis (without jumps over the cycle, between -180° and 180° at crank angle zero)."""
    # of a link that turns fully it jumps at crank angle zero, where a panel must end: see `Measure.breaks`
    machine, grid = of.machine, jax.lax.stop_gradient(of.grid)
    turned = whole_turns(of)

    def at(regime: Regime, at: At) -> Vectors:
        return machine.run(_angles, grid, turned, at.place, at.pose, elements=elements)

    return at


class Turned(NamedTuple):
    """Angles of all links (rad) without jumps, and their rates, at the nodes, shape (links, panels, n); and how much
    each grows in a cycle: zero, or whole turns for a link that turns fully."""

    angle: Array
    rate: Array
    net: Array


def whole_turns(of: Parts) -> Turned:
    """The angles of all links at the nodes, without derivatives."""
    grid, pose = jax.lax.stop_gradient((of.grid, of.at.sample.pose))
    return of.once(whole_turns, lambda: of.machine.run(_turned, grid, pose))


def net_turn(of: Parts, element: str) -> Array:
    """By how much the angle of a link grows in a cycle (rad)."""
    return whole_turns(of).net[sorted(of.scene.mechanism.links).index(element)]


@compiled_soon
def _turned(grid: Grid, pose: Pose) -> Turned:
    """From node to node a link turns by its mean rate, up to whole turns."""
    phi, links = grid.nodes.ravel(), [pose.links[name] for name in sorted(pose.links)]
    span = jnp.concatenate([jnp.diff(phi), phi[:1] + grid.length - phi[-1:]])
    w = jnp.stack([link.w for link in links])[:, : phi.size]
    u = jnp.stack([jnp.arctan2(link.u.y, link.u.x) for link in links])[:, : phi.size]
    rise = jnp.roll(u, -1, axis=1) - u
    steps = 0.5 * (w + jnp.roll(w, -1, axis=1)) * span[None]
    steps = rise + 2 * np.pi * jnp.round((steps - rise) / (2 * np.pi))
    net = 2 * np.pi * jnp.round(jnp.sum(steps, axis=1) / (2 * np.pi))
    angle = jnp.cumsum(jnp.concatenate([u[:, :1], steps[:, :-1]], axis=1), axis=1)
    angle -= net[:, None] * jnp.floor(phi / grid.length)[None]
    first = jnp.argmin(jnp.mod(phi, grid.length))
    angle -= 2 * np.pi * jnp.round(angle[:, first] / (2 * np.pi))[:, None]
    shape = (len(links), *grid.nodes.shape)
    return Turned(angle.reshape(shape), w.reshape(shape), net)


@compiled_soon(static=("elements",))
def _angles(grid: Grid, turned: Turned, place: Place, pose: Pose, elements: Elements) -> Vectors:
    """Angles at places: those of the pose, with the whole turns of the nearest node."""
    names = sorted(pose.links)
    which = np.asarray([names.index(name) for name in elements])
    node = jnp.searchsorted(jnp.asarray(0.5 * (grid.rule.x[1:] + grid.rule.x[:-1])), place.x)
    phi = grid.nodes[place.panel, node]
    after = jnp.floor(phi / grid.length) - jnp.floor(place.side / grid.length)  # of a node beyond the end of the cycle
    angle, rate = (part[which][:, place.panel, node] for part in (turned.angle, turned.rate))
    near = angle + rate * (place.phi - phi)[None] + turned.net[which][:, None] * after[None]
    exact = jnp.stack([jnp.arctan2(pose.links[name].u.y, pose.links[name].u.x) for name in elements])
    return _stacked(near + nearest_turn(exact - near, 2 * np.pi))


@quantity("m", "point", moves=False, names=sliding_points)
def travel(of: Parts, elements: Elements):
    """Coordinate of a point of a slider along its guide, from the point that the guide passes through."""
    along = {name: of.scene.mechanism.guides_of(name)[0] for name in elements}
    return lambda regime, at: of.machine.run(_travels, along, at.pose, elements=elements)


@compiled_soon(static=("elements",))
def _travels(along: dict[str, Guide], pose: Pose, elements: Elements) -> Vectors:
    def seen(links, points):
        return [along[name].line(links, points).along(points[name]).value for name in elements]

    return _stacked(jax.vmap(seen)(pose.links, pose.points))


@quantity("N", "joint", vector=True, kinks=True, forced=True)
def reaction(of: Parts, elements: Elements):
    """Force in a joint on a link (of a guide the component along the left normal of its direction)."""
    return lambda regime, at: by_forces(of, elements, at.pose, regime.forces(at))


def by_forces(of: Parts, elements: Elements, pose: Pose, forces: Forces) -> Vectors:
    """The joint forces of elements, "joint.link", among all forces at places with this pose."""
    pairs = tuple((*name.rpartition(".")[::2],) for name in elements)
    return of.machine.run(_reactions, guides(of.scene, elements), pose, forces, elements=elements, pairs=pairs)


@compiled_soon(static=("elements", "pairs"))
def _reactions(
    along: dict[str, Guide], pose: Pose, forces: Forces, elements: Elements, pairs: tuple[tuple[str, str], ...]
) -> Vectors:
    def on_links(links, points, reactions):
        found = []
        for name, (joint, link) in zip(elements, pairs, strict=True):
            force = reactions[joint][link]
            if name in along:
                t = along[name].line(links, points).t
                found.append(jnp.stack([t.x * force.fy - t.y * force.fx, jnp.zeros_like(t.x)]))
            else:
                found.append(jnp.stack([force.fx, force.fy]))
        return jnp.stack(found)

    return jnp.moveaxis(jax.vmap(on_links)(pose.links, pose.points, forces.reactions), 0, -1)


@compiled_soon
def _shaking(pose: Pose, speed: Array, acceleration: Array) -> Vectors:
    first, second = mass_sums(pose)
    force = -(second * speed**2 + first * acceleration).once()
    return jnp.stack([force.x, force.y])[None]


@quantity("N", "", vector=True)
def shaking_force(of: Parts, elements: Elements):
    """Shaking force (the inertia force on the frame)."""
    return lambda regime, at: regime.machine.run(_shaking, at.pose, *regime.crank(at))


@compiled_soon(static=("what",))
def _of_forces(forces: Forces, speed: Array, what: str) -> Vectors:
    if what == "drive_torque":
        return _stacked([known_torque(forces)])
    if what == "drive_power":
        return _stacked([known_torque(forces) * speed])
    if what == "shaking_moment":
        return _stacked([forces.shaking.moment])
    force = forces.frame if what == "frame_force" else forces.net_frame
    return jnp.stack([force.fx, force.fy])[None]


def _asked_of_forces(what: str) -> Callable[[Regime, At], Vectors]:
    return lambda regime, at: regime.machine.run(_of_forces, regime.forces(at), regime.crank(at)[0], what=what)


@quantity("N m", "")
def shaking_moment(of: Parts, elements: Elements):
    """Shaking moment about the crank pivot (the inertia moment on the frame)."""
    return _asked_of_forces("shaking_moment")


@quantity("N", "", vector=True, forced=True)
def frame_force(of: Parts, elements: Elements):
    """Force on the frame through its joints."""
    return _asked_of_forces("frame_force")


@quantity("N", "", vector=True, forced=True)
def net_frame_force(of: Parts, elements: Elements):
    """Force on the foundation (that on the frame and the reactions of loads on the frame)."""
    return _asked_of_forces("net_frame_force")


@quantity("N m", "", forced=True)
def drive_torque(of: Parts, elements: Elements):
    """Drive torque (by kinetostatics, positive along the rotation of the crank)."""
    return _asked_of_forces("drive_torque")


@quantity("W", "", forced=True)
def drive_power(of: Parts, elements: Elements):
    """Power of the drive."""
    return _asked_of_forces("drive_power")


@quantity("rad/s", "", motor=True)
def motor_speed(of: Parts, elements: Elements):
    """Speed of the motor's own shaft."""
    return asked_of_motor("speed")


@quantity("N m", "", motor=True, forced=True)
def motor_torque(of: Parts, elements: Elements):
    """Torque of the motor at its own shaft (with what accelerates the rotor and what the transmission loses)."""
    return asked_of_motor("torque")


@quantity("W", "", motor=True, forced=True)
def motor_power(of: Parts, elements: Elements):
    """Power of the motor at its own shaft."""
    return asked_of_motor("power")


@compiled_soon
def _speeds(speed: Array) -> Vectors:
    return _stacked([speed])


@quantity("rad/s", "")
def crank_speed(of: Parts, elements: Elements):
    """Crank speed."""
    return lambda regime, at: regime.machine.run(_speeds, regime.crank(at)[0])


@compiled_soon(static=("elements",))
def _transmission(angles: dict[str, Array], elements: Elements) -> Vectors:
    return _stacked([angles[name] for name in elements])


@quantity("rad", "group", moves=False, asks="gaps", names=lambda scene: turning_groups(scene))
def transmission_angle(of: Parts, elements: Elements):
    """Transmission angle of a group."""
    return lambda regime, at: regime.machine.run(_transmission, at.transmission, elements=elements)


@compiled_soon(static=("elements",))
def _off_square(angles: dict[str, Array], elements: Elements) -> Vectors:
    return _stacked([angles[name] - 0.5 * np.pi for name in elements])


@quantity("rad", "group", moves=False, asks="gaps", names=lambda scene: turning_groups(scene))
def off_square(of: Parts, elements: Elements):
    """Transmission angle of a group beyond a right angle."""
    return lambda regime, at: regime.machine.run(_off_square, at.transmission, elements=elements)


def turning_groups(scene: Scene) -> Elements:
    """The groups that have a transmission angle."""
    groups = list(named_groups(scene.mechanism).items())
    return tuple(name for name, group in groups[1:] if not (group.numerical() or group.wheels() or group.passive()))
