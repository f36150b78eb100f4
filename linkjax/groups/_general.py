"""Groups of higher class, solved numerically: links and joints closed by Newton's method from a reference path.

These are class III and higher (triads, tetrads), and groups that contain a drive. The closure equations of all joints
are solved simultaneously; kinematic coefficients and reactions follow from the same Jacobian.
Source: any text on constrained planar systems, e.g. Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems,
1989, ch. 3 (closure, rates) and ch. 8 (reactions as multipliers).
"""

from __future__ import annotations

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._lapack import inverted, mean_of_determinant, solve
from linkjax._numerics import largest, nearest_turn, safe_sqrt, smallest
from linkjax._vec import Vec, unit, zero
from linkjax.groups._base import BEYOND, Margin, Wrench
from linkjax.groups._chain import AbstractChain
from linkjax.groups._closure import (
    Closure,
    ClosureEquations,
    Found,
    Geared,
    Known,
    Placed,
    array,
    least_singular,
    placed,
)
from linkjax.groups._counted_turns import CountedTurns, counted, uncounted
from linkjax.groups._drawn import from_sketch
from linkjax.groups._pairs import FRAME
from linkjax.groups._reference_path import Meshing, closed_to, met
from linkjax.groups._state import LinkState, PointState, carried

FAR = 60  # damped steps from a sketch
LAST = 2  # steps with one inverse, after those of `ClosureEquations.near`
SWING = 0.2  # largest motion of links in these steps, relative to the size

Places = dict[str, dict[str, Vec]]  # of every member: positions of its points in its own axes


class General(AbstractChain):
    """Links joined by pins, slots and gears in mesh, solved simultaneously.

    `members` are the links with the points at which each is pinned: the first is its origin, the second is on its axis
    at its length, others are coupler points. A point of two members is a pin between them; `outer` are the points that
    exist already. `slots` are the sliding joints: a block has one point, its origin, and the axes of its guide. `gears`
    are the gears and racks whose `link` is a member, written as separate groups; a rack is the block of a slot.
    `sketch` selects the assembly mode by approximate positions (m) at crank angle zero: two points of every link, one
    of a block, and one of a gear that is pinned once and not driven. A group with a `drive` comes first. Raises
    `ValueError` where members, joints and drive do not remove all degrees of freedom, and for an incomplete sketch.
    """

    kind: ClassVar[str] = "general"

    def followed(self, counted):
        return True

    # ---- closure

    def _outside(self, known: Known) -> tuple[Array, Array]:
        """Positions and directions of what the group is attached to: points, then guides outside its links."""
        points, guides = self._outer_points(), self.guides()
        along = [Vec(jnp.ones(()), jnp.zeros(()))] * len(points)
        along += [known.links[g.on] if g.on != "frame" else Vec(jnp.ones(()), jnp.zeros(())) for g in guides]
        return array([known.points[p] for p in (*points, *(g.through for g in guides))]), array(along)

    def _equations(self) -> ClosureEquations:
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
        return ClosureEquations(len(names), one, two, block, on, self.driven_slot(), turns)

    def _geared(self, known: Known, size: Array, meshing: Meshing | None) -> Geared | None:
        """What its gears keep constant."""
        names, still = self.link_names(), jnp.zeros_like(size)
        rows = []
        for gear in self.gears:
            held, per = gear.coupling(), jnp.ones_like(size) if gear.sliding() else size
            outside = [held.angles[name] * known.angles[name] for name in held.angles if name in known.angles]
            rows.append(Geared(
                per * jnp.stack([held.angles.get(name, still) for name in names]),
                jnp.stack([still, *(held.ways.get(slot.block, still) for slot in self.slots)])[1:],
                per * (held.constant - sum(outside, still)),
            ))  # fmt: skip
        if not rows:
            return None
        held = Geared(*(jnp.stack(parts) for parts in zip(*rows, strict=True)))
        if meshing is None:
            return held
        return held._replace(wanted=held.wanted + 2 * jnp.pi * size * meshing.whole)

    def _closure(self, places, known: Known, drive: Array, meshing: Meshing | None = None) -> Closure:
        """The values in the closure equations."""
        pairs, none, names = self._pairs(), Vec(jnp.zeros(()), jnp.zeros(())), self.link_names()
        through = [places[s.guide.on][s.guide.through] if s.guide.on in names else none for s in self.slots]
        size = self._size(places, known.points)
        return Closure(
            array([places[link][p] for p, link, _ in pairs]),
            array([places[to][p] if to else none for p, _, to in pairs]),
            array(through), array([unit(slot.guide.along) for slot in self.slots]),
            jnp.stack([slot.guide.offset for slot in self.slots]) if self.slots else jnp.zeros(0),
            *self._outside(known), size, drive, self._geared(known, size, meshing),
        )  # fmt: skip

    def size(self, links, points) -> Array:
        """Reference length (m): the largest arm of a pin; for blocks alone the distance of the outer points."""
        return self._size(self.places(links), {name: at.r for name, at in points.items()})

    def _size(self, places, outside) -> Array:
        arms = [places[link][point].squared() for link, points in self.members for point in points]
        if all(len(points) == 1 for _, points in self.members):
            spots = [outside[name] for name in self.needs()]
            arms += [(at - spots[0]).squared() for at in spots] + [slot.guide.offset**2 for slot in self.slots]
        return safe_sqrt(largest(jnp.stack(arms)), 1.0)

    def _known(self, states, points, phi=None, meshing: Meshing | None = None, t: Array | float = 0.0) -> Known:
        """Existing points and links, a crank angle `t` later (to second order); angles only where `phi` is given."""
        half = 0.5 * t * t
        links = {g.on: states[g.on] for g in self.guides() if g.on != "frame"}
        turns, angles = None if meshing is None else meshing.turns, {}
        if phi is not None:
            angles = {name: counted(name, k, states, turns, phi) for k, name in enumerate(self.mates())}
        return Known(
            {name: points[name].r + points[name].dr * t + points[name].ddr * half for name in self.needs()},
            {name: s.u + s.u.perp() * (s.w * t + s.e * half) - s.u * (s.w * s.w * half) for name, s in links.items()},
            {name: angle + w * t + e * half for name, (angle, w, e) in angles.items()},
        )

    def _at(self, links, states, points, phi: Array, meshing: Meshing | None = None) -> tuple[Places, Closure]:
        """Positions of points on the members, and the values in the closure equations, at a crank angle."""
        places = self.places(links)
        return places, self._closure(places, self._known(states, points, phi, meshing), self._drive(phi), meshing)

    def _moved_on(self, c: Closure, states, points, phi: Array, meshing: Meshing, t: Array) -> Closure:
        """The closure equations a crank angle `t` later (to second order)."""
        known = self._known(states, points, phi, meshing, t)
        (at, u), geared = self._outside(known), self._geared(known, c.size, meshing)
        return c._replace(outer_at=at, outer_u=u, drive=self._drive(phi, t), geared=geared)

    def _drive(self, phi: Array, t: Array | float = 0.0) -> Array:
        if self.drive is None:
            return jnp.zeros_like(phi)
        s, d, dd = self.drive.at(phi, self.driven_slot() is not None)
        return s + d * t + 0.5 * t * t * dd

    def sketched(self, links, states, points, phi: Array) -> Array:
        """The configuration of the sketch, shape (links, 4), or (links, 3) with gears (free gears at any angle)."""
        places, spots = self.places(links), {**{p: points[p].r for p in self.outer}, **self.sketch}
        lean = {slot.block: slot.guide for slot in self.slots}
        seen = {link: self._seen(link, pins, places) for link, pins in self.members}
        drawn = from_sketch(spots, lean, seen, places, {name: state.u for name, state in states.items()})
        if self.gears:
            return jnp.concatenate([drawn[:, :2], jnp.atan2(drawn[:, 3:], drawn[:, 2:3])], axis=1)
        return drawn

    def wound(
        self, links, states, points, phi: Array, at: Array, angle: Array, turns: CountedTurns | None = None
    ) -> tuple[Array, Array]:
        """A configuration from origins (links, 2) and angles (links,) within half a turn of zero, with free gears
        turned into mesh; also the offset of other meshes in whole turns (see `in_whole_turns`)."""
        places, c = self._at(links, states, points, phi, Meshing(turns or uncounted(), jnp.zeros(len(self.gears))))
        assert c.geared is not None
        angle = jnp.where(self.loose(), angle, nearest_turn(angle, 2 * jnp.pi))
        tied = np.asarray([self.in_whole_turns(gear) for gear in self.gears])
        whole = jnp.where(tied, jnp.round(self._equations().gears_open(at, angle, c) / (2 * jnp.pi * c.size)), 0.0)
        c = c._replace(geared=c.geared._replace(wanted=c.geared.wanted + 2 * jnp.pi * c.size * whole))
        return self._following(jnp.concatenate([at, angle[:, None]], axis=1), places, c), whole

    def loose(self) -> np.ndarray:
        """Which links are free gears (see `spinning`)."""
        return np.asarray([name in self.spinning() for name in self.link_names()])

    def _following(self, z: Array, places, c: Closure) -> Array:
        """A configuration with free gears turned into mesh, about their first known or sketched points."""
        if not (self.gears and self.loose().any()):
            return z
        seen = [places[name][self._seen(name, pins, places)[0]] for name, pins in self.members]
        return self._equations().following(z, c, np.flatnonzero(self.loose()), array(seen))

    def closed(
        self,
        links,
        states,
        points,
        phi: Array,
        start: Array,
        meshing: Meshing | None = None,
        steps: int = FAR,
        grow: float = 1.0,
    ) -> Found:
        """The configuration near `start` that closes the joints, by damped least squares (`grow`: largest growth of the
        closure error). No derivatives."""
        web, (_, c) = self._equations(), self._at(links, states, points, phi, meshing)
        c, start = jax.lax.stop_gradient((c, start))

        def step(_, carry):
            z, damping = carry
            here = placed(z)
            gap, jacobian = web.opened(here, c), web.jacobian(here, c)
            move = solve(jacobian.T @ jacobian + damping * jnp.eye(gap.size), -(jacobian.T @ gap))
            most = jnp.maximum(jnp.max(jnp.abs(move)), jnp.finfo(move.dtype).tiny)
            there = here.moved(move * jnp.minimum(1.0, 0.5 * c.size / most), c.size)
            left = jnp.sum(web.opened(there, c) ** 2)
            better = left <= grow * grow * jnp.sum(gap * gap)
            now = jnp.minimum(left / c.size**2, 0.1)  # of second order, so that the last steps are Newton steps
            return jnp.where(better, there.flat(), z), jnp.where(better, now, jnp.maximum(10 * damping, 1e-6))

        first = jnp.minimum(jnp.sum(web.opened(placed(start), c) ** 2) / c.size**2, 0.1)
        z = placed(jax.lax.fori_loop(0, steps, step, (placed(start).flat(), first))[0])
        sense = mean_of_determinant(web.jacobian(z, c))
        return Found(z.flat(), sense, jnp.max(jnp.abs(web.opened(z, c))) / c.size)

    def assembled(
        self, links, states, points, phi: Array, turns: CountedTurns | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """The same from the sketch, and the offset of meshes in whole turns. With gears it runs twice: a carrier near
        half a turn may first be one turn off."""

        def again(_, there):
            z, whole = self.wound(links, states, points, phi, there[0][:, :2], there[0][:, 2], turns)
            return *self.closed(links, states, points, phi, z, Meshing(turns or uncounted(), whole)), whole

        start, none = self.sketched(links, states, points, phi), jnp.zeros_like(phi)
        whole = jnp.zeros(len(self.gears), dtype=start.dtype)
        if self.gears:
            return jax.lax.fori_loop(0, 2, again, (start, none, none, whole))
        z, sense, gap = self.closed(links, states, points, phi, start)
        return z, sense, gap, whole

    def opened(
        self, links, states, points, phi: Array, z: Array, move: Array, meshing: Meshing | None = None
    ) -> tuple[Array, Array]:
        """Closure errors (m) of a configuration moved by x, y and angle times size of every link (m), and their
        derivatives with respect to these."""
        web, (_, c) = self._equations(), self._at(links, states, points, phi, meshing)
        here = placed(z).moved(move, c.size)
        return web.opened(here, c), web.jacobian(here, c)

    def reversed(self, links, states, points, phi: Array, z: Array) -> Array:
        """Whether a block, or the link that the drive turns, is reversed by half a turn in a configuration."""
        return self._equations().reversed(placed(z), self._at(links, states, points, phi)[1])

    def solve(self, links, states, points, phi, path=None):
        assert path is not None  # see `kinematics.prepared`
        web, (places, c) = self._equations(), self._at(links, states, points, phi, path.meshing)
        still, fixed, at = jax.lax.stop_gradient((c, path, phi))
        start = self._following(fixed.at(at), jax.lax.stop_gradient(places), still)
        here = web.near(placed(start), still, fixed.sense_at(at))
        here, sound = self._polished(web, here, still)
        here = web.implicit(here, c, sound)
        matrix = jnp.where(sound, web.jacobian(here, c), jnp.eye(3 * web.links))
        inverse = inverted(matrix)

        def rate(push):
            x = -inverse @ push
            return x - inverse @ (matrix @ x + push)  # corrects rounding, which matters near singular positions

        def along(t, v):
            return web.opened(here.later(v, t, c.size), self._moved_on(c, states, points, phi, path.meshing, t))

        none, zero, one = jnp.zeros(3 * web.links), jnp.zeros_like(phi), jnp.ones_like(phi)
        v = rate(jax.jvp(lambda t: along(t, none), (zero,), (one,))[1])
        bend = jax.jvp(lambda t: jax.jvp(lambda s: along(s, v), (t,), (one,))[1], (zero,), (one,))[1]
        return self._states(here, v, rate(bend), places, c.size)

    def _polished(self, web: ClosureEquations, here: Placed, c: Closure) -> tuple[Placed, Array]:
        """The root near a configuration and whether there is one; otherwise the configuration itself. No derivatives:
        all steps use one inverse."""
        first, inverse, there = web.opened(here, c), inverted(web.jacobian(here, c)), here
        near = jnp.max(jnp.abs(inverse @ first)) < SWING * c.size  # false where it is not finite
        inverse = jnp.where(near, inverse, 0.0)
        for _ in range(LAST):
            there = there.moved(-inverse @ web.opened(there, c), c.size)
        left, before = (jnp.max(jnp.abs(gap)) for gap in (web.opened(there, c), first))
        good = (left < before) | (left < closed_to(left.dtype) * c.size)
        return jax.tree.map(lambda a, b: jnp.where(good, a, b), there, here), near

    def _states(self, here: Placed, v, a, places, size):
        found, pins = {}, {}
        v, a = v.reshape((-1, 3)), a.reshape((-1, 3))
        for i, (link, points) in enumerate(self.members):
            angle = None if here.angle is None else here.angle[i]
            found[link] = LinkState(Vec(*here.u[i]), v[i, 2] / size, a[i, 2] / size, angle)
            origin = PointState(Vec(*here.at[i]), Vec(v[i, 0], v[i, 1]), Vec(a[i, 0], a[i, 1]))
            for point in points:
                if point not in self.outer and point not in pins:
                    pins[point] = carried(origin, found[link], places[link][point])
        return found, pins

    # ---- distance to singular positions

    def _here(self, states, points) -> Placed:
        origins = [points[pins[0]].r for _, pins in self.members]
        angle = jnp.stack([states[link].angle for link in self.link_names()]) if self.gears else None
        return Placed(array(origins), array([states[link].u for link in self.link_names()]), angle)

    def _rates(self, states, points, size, of_point: str, of_link: str) -> Array:
        """Rates of x, y and angle times size of every link."""
        rows = []
        for link, pins in self.members:
            rate = getattr(points[pins[0]], of_point)
            rows += [rate.x, rate.y, size * getattr(states[link], of_link)]
        return jnp.stack(rows)

    def singular_positions(self):
        return ("loops", "apart") if self._geared_pairs() else ("loops",)

    def margins(self, links, states, points, phi, path=None):
        assert path is not None
        here, none = self._here(states, points), jnp.zeros_like(states[self.members[0][0]].w)
        web, (_, c) = self._equations(), self._at(links, states, points, phi, path.meshing)
        v, a = (self._rates(states, points, c.size, *names) for names in (("dr", "w"), ("ddr", "e")))

        def jacobian(t):
            return web.jacobian(here.later(v, t, c.size, a), self._moved_on(c, states, points, phi, path.meshing, t))

        one = jnp.ones_like(none)
        matrix, first = jax.jvp(jacobian, (none,), (one,))
        second = jax.jvp(lambda t: jax.jvp(jacobian, (t,), (one,))[1], (none,), (one,))[1]
        value, d, dd = least_singular(matrix, *jax.lax.stop_gradient((first, second)))
        gap = safe_sqrt(jnp.sum(web.opened(here, c) ** 2)) / c.size
        lost, astern = gap > closed_to(gap.dtype), web.reversed(here, c)
        beyond = path.elsewhere(phi)
        value = jnp.where(value < met(value.dtype), value - met(value.dtype), value)
        value = jnp.where(lost, -gap, jnp.where(astern, -1.0, jnp.where(beyond, -BEYOND, value)))
        found = {"loops": Margin(value, *(jnp.where(lost | astern | beyond, 0.0, rate) for rate in (d, dd)))}
        if "apart" in self.singular_positions():
            spans = [(gear.mesh, points[gear.centre].r - points[gear.pivot].r) for gear in self._geared_pairs()]
            least = smallest(jnp.stack([mesh.apart(span).value for mesh, span in spans]))
            least = jnp.where(lost, jnp.maximum(least, value), least)  # unknown where the group does not close
            found["apart"] = Margin(least, jnp.zeros_like(least), jnp.zeros_like(least))
        return found

    def shortfall(self, side, links, states, points):
        return "its loops do not close there, or only in another assembly mode" if side == "loops" else ""

    def returns(self, path):
        astray = path.ends() | path.astray()
        return ~(astray | path.meshing.turns.too_fast() if self.mates() else astray)

    def transmission(self, states, points):
        return None

    # ---- reactions

    def react(self, loads, states, points):
        here, names = self._here(states, points), self.link_names()
        places: dict[str, dict[str, Vec]] = {}
        for i, (link, pins) in enumerate(self.members):
            through = [slot.guide.through for slot in self.slots if slot.guide.on == link]
            back = Vec(here.u[i, 0], -here.u[i, 1])
            places[link] = {p: (points[p].r - points[pins[0]].r).turned(back) for p in (*pins, *through)}
        turns = self.drive if self.driven_slot() is None else None
        none = jnp.zeros_like(here.at[0, 0])
        c = self._closure(places, self._known(states, points), none if turns is None else turns.angle(states))
        on = [(loads[link].force, loads[link].moment / c.size) for link in names]
        load = jnp.concatenate([jnp.stack([force.x, force.y, moment]) for force, moment in on])
        x = solve(self._equations().jacobian(here, c).T, -load)  # multipliers: forces of the joints
        pairs = self._pairs()
        pins = [Wrench(Vec(x[2 * k], x[2 * k + 1]), none) for k in range(len(pairs))]
        slots = []
        for number, slot in enumerate(self.slots):
            k, t = 2 * (len(pairs) + number), states[slot.block].u
            slots.append(Wrench(t.perp() * x[k], x[k + 1] * c.size))
        meshes = self._teeth(x[2 * len(pairs) + 2 * len(slots) :], c.size, pins, slots, states, points)
        drive, torque = [], None
        k = self.driven_slot()
        if k is not None:
            drive = [Wrench(states[self.slots[k].block].u * x[-1], none)]
            torque = x[-1] * self._pace(self.slots[k], states, points)
        elif self.drive is not None:
            drive = [Wrench(zero(), x[-1] * c.size)]
            on = none if self.drive.on == "frame" else states[self.drive.on].w
            torque = x[-1] * c.size * (states[self.drive.link].w - on)
        return (*pins, *slots, *meshes, *drive), torque
