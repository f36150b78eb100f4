"""Groups of any class: links and joints as they are drawn, closed by Newton's method from a reference path.

Class III and higher (triads, tetrads), and groups with a drive inside them. Positions solve the closure equations of
all joints at once; kinematic coefficients and reactions follow from the same Jacobian.
Source: any text on constrained planar systems, e.g. Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems,
1989, ch. 3 (closure, rates) and ch. 8 (reactions as multipliers).
"""

from __future__ import annotations

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import largest, safe_sqrt
from linkjax._vec import Vec, unit, zero
from linkjax.groups._base import BEYOND, AbstractGroup, Joint, Margin, Wrench
from linkjax.groups._closure import Closure, Known, Placed, Web, array, least_singular, placed
from linkjax.groups._drawn import Drive, Slot, check_drawn, check_drive, driven_slot, from_sketch, undrawn
from linkjax.groups._pairs import FRAME, classified
from linkjax.groups._state import LinkState, PointState, carried
from linkjax.groups._track import Track, closed_to

NEAR, LAST = 4, 3  # steps from the reference path: damped ones, and those with one inverse that carry derivatives
SWING = 0.2  # of the size: what they may move links


class General(AbstractGroup):
    """Links joined by pins and slots, solved together.

    `members` are the links with the points at which each is pinned: the first is its origin, the second lies on its
    axis at its length, further ones are marked points of it. A point that two members name is a pin between them;
    `outer` are the points that exist already. `slots` are the sliding joints: a block has one point, its origin, and
    the axes of its guide. `sketch` says roughly where points are at crank angle zero, which chooses the assembly: of
    every link two points, of a block one. With a `drive` the group stands first and moves by itself. `path` and `turns`
    are filled in by `kinematics.prepared`.
    """

    kind: ClassVar[str] = "general"
    dead_positions: ClassVar[tuple[str, ...]] = ("loops",)

    members: tuple[tuple[str, tuple[str, ...]], ...] = eqx.field(static=True)
    outer: tuple[str, ...] = eqx.field(static=True)
    sketch: dict[str, Vec]
    slots: tuple[Slot, ...] = ()
    drive: Drive | None = None
    path: Track | None = None
    turns: int = eqx.field(static=True, default=1)

    def __check_init__(self):
        names = [link for link, _ in self.members]
        check_drawn(names, self.slots, self.sketch)
        if self.drive is not None:
            check_drive(self.drive, names, self.slots)
        rows = sum(2 * (len(links) - (point not in self.outer)) for point, links in self._pins().items())
        rows += 2 * len(self.slots) + (self.drive is not None)
        if rows != 3 * len(names):
            problem = f"{len(names)} links have {3 * len(names)} degrees of freedom, their joints take {rows}"
            raise ValueError(f"the group of {', '.join(names)} is none: {problem}; a point may be missing in `outer`")

    def driven_slot(self) -> int | None:
        """Number of the slot that the drive moves; None for a drive that turns, and for none."""
        return None if self.drive is None else driven_slot(self.drive, self.slots)

    def translating(self):
        return tuple(slot.block for slot in self.slots if slot.guide.on == FRAME)

    def _pins(self) -> dict[str, list[str]]:
        """Every pinned point with the members that share it."""
        found: dict[str, list[str]] = {}
        for link, points in self.members:
            for point in points:
                found.setdefault(point, []).append(link)
        return {p: links for p, links in found.items() if len(links) > 1 or p in self.outer}

    def classified(self):
        names, pairs = self.link_names(), self.pairs()
        if self.drive is None:
            return classified(names, pairs)
        one, on = self.drive.link, self.drive.on  # one link, as long as the drive is held
        held = [p._replace(one=on if p.one == one else p.one, other=on if p.other == one else p.other) for p in pairs]
        rest = tuple(name for name in names if name != one)
        found, letters = classified(rest, [p for p in held if p.one != p.other])
        return f"I1+{found}", letters

    def link_names(self):
        return tuple(link for link, _ in self.members)

    def needs(self):
        inside = set(self.link_names())
        return (*self.outer, *(slot.guide.through for slot in self.slots if slot.guide.on not in inside))

    def guides(self):
        return tuple(slot.guide for slot in self.slots if slot.guide.on not in self.link_names())

    def pins(self):
        return {link: (points[0], points[1] if len(points) > 1 else None) for link, points in self.members}

    def brings(self):
        ends = [p for pair in self.pins().values() for p in pair if p is not None]
        return tuple(dict.fromkeys(p for p in ends if p not in self.outer))

    def shared(self):
        return {p: "" if p in self.outer else links[0] for p, links in self._pins().items()}

    def driving(self):
        return None if self.drive is None else self.drive.link

    def follows(self):
        return None if self.drive is None else self.drive.law

    # ---- closure

    def places(self, links) -> dict[str, dict[str, Vec]]:
        """Where the points of every member are in its own axes."""
        found = {}
        for link, points in self.members:
            zero = jnp.zeros_like(links[link].length)
            body = links[link].actual()
            found[link] = {**body.points, links[link].centre_name: body.centre, points[0]: Vec(zero, zero)}
            if len(points) > 1:
                found[link].setdefault(points[1], Vec(links[link].length, zero))
        return found

    def _pairs(self) -> list[tuple[str, str, str]]:
        """Every pin as (point, link, what it is pinned to): another link, or "" for a point that was there before."""
        return [(p, link, "" if p in self.outer else links[0]) for p, links in self._pins().items()
                for link in links[p not in self.outer :]]  # fmt: skip

    def _outer_points(self) -> list[str]:
        return list(dict.fromkeys(p for p, _, to in self._pairs() if not to))

    def _outside(self, known: Known) -> tuple[Array, Array]:
        """Places and directions of what the group hangs on: points, then guides that are not on its own links."""
        points, guides = self._outer_points(), self.guides()
        along = [Vec(jnp.ones(()), jnp.zeros(()))] * len(points)
        along += [known.links[g.on] if g.on != "frame" else Vec(jnp.ones(()), jnp.zeros(())) for g in guides]
        return array([known.points[p] for p in (*points, *(g.through for g in guides))]), array(along)

    def _web(self) -> Web:
        """The closure equations."""
        names, pairs, outer = list(self.link_names()), self._pairs(), self._outer_points()
        inside = [slot.guide.on in names for slot in self.slots]
        row_of = {p: len(names) + i for i, p in enumerate(outer)}
        count = len(names) + len(outer) + inside.count(False)
        one, two = np.zeros((2, len(pairs), count))
        for row, (point, link, to) in enumerate(pairs):
            one[row, names.index(link)] = two[row, names.index(to) if to else row_of[point]] = 1
        block, on = np.zeros((2, len(self.slots), count))
        for row, slot in enumerate(self.slots):
            block[row, names.index(slot.block)] = 1
            on[row, names.index(slot.guide.on) if inside[row] else count - inside[row:].count(False)] = 1
        turns = None
        if self.drive is not None and self.driven_slot() is None:
            against = None if self.drive.on == FRAME else names.index(self.drive.on)
            turns = (names.index(self.drive.link), against)
        return Web(len(names), one, two, block, on, self.driven_slot(), turns)

    def _closure(self, places, known: Known, drive: Array) -> Closure:
        """The numbers of the closure equations."""
        pairs, none, names = self._pairs(), Vec(jnp.zeros(()), jnp.zeros(())), self.link_names()
        through = [places[s.guide.on][s.guide.through] if s.guide.on in names else none for s in self.slots]
        return Closure(
            array([places[link][p] for p, link, _ in pairs]),
            array([places[to][p] if to else none for p, _, to in pairs]),
            array(through), array([unit(slot.guide.along) for slot in self.slots]),
            jnp.stack([slot.guide.offset for slot in self.slots]) if self.slots else jnp.zeros(0),
            *self._outside(known), self._size(places), drive,
        )  # fmt: skip

    def size(self, links) -> Array:
        """A length to measure by (m): the largest arm of a pin."""
        return self._size(self.places(links))

    def _size(self, places) -> Array:
        inner = {p for _, points in self.members for p in points}
        arms = [at.squared() for each in places.values() for p, at in each.items() if p in inner]
        return safe_sqrt(largest(jnp.stack(arms)), 1.0)

    def _known(self, states, points, t=0.0) -> Known:
        """What was there before, `t` of crank angle later (to second order)."""
        half = 0.5 * t * t
        links = {g.on: states[g.on] for g in self.guides() if g.on != "frame"}
        return Known(
            {name: points[name].r + points[name].dr * t + points[name].ddr * half for name in self.needs()},
            {name: u + u.perp() * (w * t + e * half) - u * (w * w * half) for name, (u, w, e, _) in links.items()},
        )

    def _drive(self, phi: Array, t=0.0) -> Array:
        if self.drive is None:
            return jnp.zeros_like(phi)
        s, d, dd = self.drive.at(phi, self.driven_slot() is not None)
        return s + d * t + 0.5 * t * t * dd

    def sketched(self, places, states, points) -> Array:
        """The configuration that the sketch gives, shape (links, 4)."""
        spots = {**{p: points[p].r for p in self.outer}, **self.sketch}
        lean = {slot.block: slot.guide for slot in self.slots}
        seen = {link: self._seen(link, pins, places) for link, pins in self.members}
        return from_sketch(spots, lean, seen, places, {name: state.u for name, state in states.items()})

    def _seen(self, link: str, pins: tuple[str, ...], places) -> list[str]:
        """Points of a link whose places are known or sketched."""
        return [p for p in dict.fromkeys((*pins, *places[link])) if p in self.outer or p in self.sketch]

    def lacking(self, links):
        blocks = {slot.block: slot.guide for slot in self.slots}
        for block, guide in blocks.items():
            if block not in self.link_names():
                return f"the block {block!r} is no member of the group", f"known here: {', '.join(self.link_names())}"
            pins = dict(self.members).get(guide.on)
            if pins is not None and guide.through not in (*pins, *links[guide.on].points):
                problem = f"the guide of {block!r} is on link {guide.on!r}, but point {guide.through!r} is not"
                return problem, f"known here: {', '.join((*pins, *links[guide.on].points))}"
        return undrawn(self.members, links, self.sketch, self.outer, blocks)

    def closed(self, links, states, points, phi: Array, start: Array, steps: int) -> tuple[Array, Array, Array]:
        """The configuration near `start` that closes the joints, by damped least squares, the sense of its Jacobian's
        determinant, and what it leaves open, of the size of the group; without derivatives."""
        web, c = self._web(), self._closure(self.places(links), self._known(states, points), self._drive(phi))
        c, start = jax.lax.stop_gradient((c, start))

        def step(_, carry):
            z, damping = carry
            here = placed(z)
            gap, jacobian = web.opened(here, c), web.jacobian(here, c)
            move = jnp.linalg.solve(jacobian.T @ jacobian + damping * jnp.eye(gap.size), -(jacobian.T @ gap))
            most = jnp.maximum(jnp.max(jnp.abs(move)), jnp.finfo(move.dtype).tiny)
            there = here.moved(move * jnp.minimum(1.0, 0.5 * c.size / most), c.size)
            left = jnp.sum(web.opened(there, c) ** 2)
            better = left <= jnp.sum(gap * gap)
            now = jnp.minimum(left / c.size**2, 0.1)  # of second order, so that the last steps are Newton's
            return jnp.where(better, there.flat(), z), jnp.where(better, now, jnp.maximum(10 * damping, 1e-6))

        first = jnp.minimum(jnp.sum(web.opened(placed(start), c) ** 2) / c.size**2, 0.1)
        z = placed(jax.lax.fori_loop(0, steps, step, (placed(start).flat(), first))[0])
        sense = jnp.linalg.slogdet(web.jacobian(z, c))[0]
        return z.flat(), sense, jnp.max(jnp.abs(web.opened(z, c))) / c.size

    def solve(self, links, states, points, phi):
        assert self.path is not None  # see `kinematics.prepared`
        z = self.closed(links, states, points, phi, self.path.at(phi, self.turns), NEAR)[0]
        web, places = self._web(), self.places(links)
        c = self._closure(places, self._known(states, points), self._drive(phi))
        here, sound = self._polished(web, placed(jax.lax.stop_gradient(z)), c)
        inverse = jnp.linalg.inv(jnp.where(sound, web.jacobian(here, c), jnp.eye(3 * web.links)))

        def along(t, v):
            at, u = self._outside(self._known(states, points, t))
            return web.opened(here.later(v, t, c.size), c._replace(outer_at=at, outer_u=u, drive=self._drive(phi, t)))

        none, zero, one = jnp.zeros(3 * web.links), jnp.zeros_like(phi), jnp.ones_like(phi)
        v = -inverse @ jax.jvp(lambda t: along(t, none), (zero,), (one,))[1]
        bend = jax.jvp(lambda t: jax.jvp(lambda s: along(s, v), (t,), (one,))[1], (zero,), (one,))[1]
        return self._states(here, v, -inverse @ bend, places, c.size)

    def _polished(self, web: Web, here: Placed, c: Closure) -> tuple[Placed, Array]:
        """The root near a configuration, with derivatives up to the third order, and whether there is one; else the
        configuration itself.

        Steps with one and the same inverse, which has no derivatives: each makes those of one more order right.
        """
        first = web.opened(here, c)
        inverse = jax.lax.stop_gradient(jnp.linalg.inv(web.jacobian(here, c)))
        near = jnp.max(jnp.abs(inverse @ jax.lax.stop_gradient(first))) < SWING * jax.lax.stop_gradient(c.size)
        inverse, there = jnp.where(near, inverse, 0.0), here  # false where it is not finite
        for _ in range(LAST):
            there = there.moved(-inverse @ web.opened(there, c), c.size)
        left, before = (jnp.max(jnp.abs(jax.lax.stop_gradient(gap))) for gap in (web.opened(there, c), first))
        good = (left < before) | (left < closed_to(left.dtype) * c.size)
        return jax.tree.map(lambda a, b: jnp.where(good, a, b), there, here), near

    def _states(self, here: Placed, v, a, places, size):
        found, pins = {}, {}
        v, a = v.reshape((-1, 3)), a.reshape((-1, 3))
        for i, (link, points) in enumerate(self.members):
            found[link] = LinkState(Vec(*here.u[i]), v[i, 2] / size, a[i, 2] / size)
            origin = PointState(Vec(*here.at[i]), Vec(v[i, 0], v[i, 1]), Vec(a[i, 0], a[i, 1]))
            for point in points:
                if point not in self.outer and point not in pins:
                    pins[point] = carried(origin, found[link], places[link][point])
        return found, pins

    # ---- closeness to where it cannot be assembled

    def _here(self, states, points) -> Placed:
        origins = [points[pins[0]].r for _, pins in self.members]
        return Placed(array(origins), array([states[link].u for link in self.link_names()]))

    def _rates(self, states, points, size, of_point: str, of_link: str) -> Array:
        """Rates of x, y and angle times size of every link."""
        rows = []
        for link, pins in self.members:
            rate = getattr(points[pins[0]], of_point)
            rows += [rate.x, rate.y, size * getattr(states[link], of_link)]
        return jnp.stack(rows)

    def margins(self, links, states, points, phi):
        here, none = self._here(states, points), jnp.zeros_like(states[self.members[0][0]].w)
        web, c = self._web(), self._closure(self.places(links), self._known(states, points), self._drive(phi))
        v, a = (self._rates(states, points, c.size, *names) for names in (("dr", "w"), ("ddr", "e")))

        def jacobian(t):
            at, u = self._outside(self._known(states, points, t))
            there = c._replace(outer_at=at, outer_u=u, drive=self._drive(phi, t))
            return web.jacobian(here.later(v, t, c.size, a), there)

        one = jnp.ones_like(none)
        matrix, first = jax.jvp(jacobian, (none,), (one,))
        second = jax.jvp(lambda t: jax.jvp(jacobian, (t,), (one,))[1], (none,), (one,))[1]
        value, d, dd = least_singular(matrix, *jax.lax.stop_gradient((first, second)))
        gap = safe_sqrt(jnp.sum(web.opened(here, c) ** 2)) / c.size
        lost, beyond = (
            gap > closed_to(gap.dtype),
            jnp.asarray(False) if self.path is None else self.path.elsewhere(phi, self.turns),
        )
        value = jnp.where(lost, -gap, jnp.where(beyond, -BEYOND, value))
        return {"loops": Margin(value, *(jnp.where(lost | beyond, 0.0, rate) for rate in (d, dd)))}

    def returns(self):
        return None if self.path is None else ~(self.path.closes() & self.path.astray())

    def transmission(self, states, points):
        return None

    # ---- reactions

    def joints(self):
        found = []
        for point, links in self._pins().items():
            by = None if point in self.outer else links[0]
            found += [Joint(point, point, link, by) for link in links[point not in self.outer :]]
        origins = {link: points[0] for link, points in self.members}
        for slot in self.slots:
            found.append(Joint(f"{slot.block}.guide", origins[slot.block], slot.block, slot.guide.on, slides=True))
        if self.drive is not None:
            found.append(Joint(f"{self.drive.link}.drive", origins[self.drive.link], self.drive.link, self.drive.on))
        return tuple(found)

    def react(self, loads, states, points):
        here, names = self._here(states, points), self.link_names()
        places: dict[str, dict[str, Vec]] = {}
        for i, (link, pins) in enumerate(self.members):
            through = [slot.guide.through for slot in self.slots if slot.guide.on == link]
            back = Vec(here.u[i, 0], -here.u[i, 1])
            places[link] = {p: (points[p].r - points[pins[0]].r).turned(back) for p in (*pins, *through)}
        turns = self.drive if self.driven_slot() is None else None
        web = self._web()
        c = self._closure(places, self._known(states, points), jnp.zeros(()) if turns is None else turns.angle(states))
        on = [(loads[link].force, loads[link].moment / c.size) for link in names]
        load = jnp.concatenate([jnp.stack([force.x, force.y, moment]) for force, moment in on])
        x = jnp.linalg.solve(web.jacobian(here, c).T, -load)  # multipliers: what the joints exert
        count = len(self._pairs())
        none = jnp.zeros_like(x[0])
        wrenches = [Wrench(Vec(x[2 * k], x[2 * k + 1]), none) for k in range(count)]
        drive, torque = [], None
        for number, slot in enumerate(self.slots):
            k, t = 2 * (count + number), states[slot.block].u
            wrenches.append(Wrench(t.perp() * x[k], x[k + 1] * c.size))
        k = self.driven_slot()
        if k is not None:
            drive = [Wrench(states[self.slots[k].block].u * x[-1], none)]
            torque = x[-1] * self._pace(self.slots[k], states, points)
        elif self.drive is not None:
            drive = [Wrench(zero(), x[-1] * c.size)]
            on = none if self.drive.on == "frame" else states[self.drive.on].w
            torque = x[-1] * c.size * (states[self.drive.link].w - on)
        return (*wrenches, *drive), torque

    def _pace(self, slot: Slot, states, points) -> Array:
        """How fast the block of a slot moves along it."""
        block, base = points[dict(self.members)[slot.block][0]], points[slot.guide.through]
        under = base.dr
        if slot.guide.on != "frame":
            under = under + (block.r - base.r).perp() * states[slot.guide.on].w
        return (block.dr - under).dot(states[slot.block].u)
