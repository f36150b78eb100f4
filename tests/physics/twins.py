# pyright: reportArgumentType=false, reportAttributeAccessIssue=false
"""The same machines twice: every group in closed form, and every group by Newton's method as links and joints; random
compositions, and their differences.
"""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from linkjax import PRP, RPP, RPR, RRP, RRR, Guide, Mechanism, Vec
from linkjax._compile import compiled_soon
from linkjax.groups import General, Slot
from linkjax.kinematics import pose
from linkjax.machine import ReadyScene, ready
from tests.physics import oracle
from tests.physics.judged import (
    BESIDES,
    KINDS,
    PER_CONDITION,
    by_numpy,
    conditions,
    paths_of,
    results,
    sizes,
    weights,
)
from tests.physics.random_machines import FURTHER, Batch, composed
from tests.physics.random_machines import KINDS as GROUPS


def loosely(group, at: dict) -> General:
    """A group of class II as links and joints, with a sketch that deviates slightly."""
    points: dict[str, Vec] = {}

    def sketched(*names: str) -> dict[str, Vec]:
        points.update({p: at[p].r + Vec(0.001, -0.0007) for p in names})
        return points

    if isinstance(group, RRR):
        (one, two), meet = group.links, group.meet
        return General(((one, (group.from_, meet)), (two, (group.to, meet))), (group.from_, group.to), sketched(meet))
    if isinstance(group, RRP):
        members = ((group.link, (group.from_, group.end)), (group.block, (group.end,)))
        return General(members, (group.from_,), sketched(group.end), (Slot(group.block, group.guide),))
    if isinstance(group, RPR):
        members = ((group.link, (group.about, group.end)), (group.block, (group.from_,)))
        slot = Slot(group.block, Guide(group.about, offset=group.offset, on=group.link))
        return General(members, (group.about, group.from_), sketched(group.end), (slot,))
    if isinstance(group, PRP):
        members = tuple((block, (group.meet,)) for block in group.blocks)
        return General(members, (), sketched(group.meet), tuple(map(Slot, group.blocks, group.slots)))
    assert isinstance(group, RPP)
    members = ((group.link, (group.end,)), (group.block, (group.from_,)))
    slots = Slot(group.link, group.guide), Slot(group.block, Guide(group.end, group.slot, group.offset, group.link))
    return General(members, (group.from_,), sketched(group.end), slots)


def all_loosely(mechanism: Mechanism) -> Mechanism:
    """Every group but the driver as links and joints."""
    at = jax.lax.stop_gradient(pose(mechanism, jnp.zeros(())).points)
    links = {name: mechanism.links[name] for name in mechanism.link_names}
    groups = [mechanism.groups[0], *(loosely(g, at) for g in mechanism.groups[1:])]
    return Mechanism(mechanism.fixed, links, groups, mechanism.flywheel)


class Case(NamedTuple):
    """A composition: its number, how many groups, its driver, and how many designs are drawn."""

    plan: int
    groups: int
    driver: str = ""
    designs: int = 36

    def batch(self) -> Batch:
        """Its designs in closed form. The last group is drawn as links and joints, a dyad, so that all groups before it
        are tested from the sketch to the tested angle, and six degrees further. Only those designs are used in which it
        is on its left side, and in which no group fails on that way in a fine scan."""
        kinds = np.random.default_rng(self.plan).choice(GROUPS, self.groups - 1)
        made = composed(4000 + self.plan, self.groups, self.designs, (*map(str, kinds), "dyad"), self.driver)
        m, last = made.scene.mechanism, made.scene.mechanism.groups[-1]
        ((one, (start, meet)), (two, (stop, _))) = last.members
        at, _ = oracle.assemble(m, made.phi)
        left = ((at[meet] - at[start]) / (at[stop] - at[start])).imag > 0
        links = {name: m.links[name] for name in m.link_names}
        dyad = RRR((one, two), start, stop, meet)
        scene = made.scene.with_mechanism(Mechanism(m.fixed, links, [*m.groups[:-1], dyad], m.flywheel))
        with np.errstate(invalid="ignore"):
            points, directions = oracle.assemble(scene.mechanism, np.linspace(-FURTHER, made.phi + FURTHER, 1001))
        whole = np.all([np.isfinite(z).reshape((-1, len(left))).all(0) for z in (points | directions).values()], axis=0)
        scene, *state = jax.tree.map(lambda leaf: leaf[left & whole], (scene, *made[2:]))
        return Batch(made.name, scene, *state)


def graded(scene, paths, phi, speed, acceleration, scales, keys, loose):
    """For every design: results, and the slopes of the sum of all, each by its size, times the numbers of the design in
    closed form."""

    def one(scene, paths, phi, speed, acceleration, scales):
        def total(mechanism):
            made = scene.with_mechanism(all_loosely(mechanism) if loose else mechanism)
            found = results(ReadyScene(made, paths) if loose else ready(made), phi, speed, acceleration, keys)
            return sum(found[kind] @ jnp.asarray(weights(found[kind].size)) / scales[kind] for kind in KINDS), found

        slopes, found = jax.grad(total, has_aux=True)(scene.mechanism)
        leaves = zip(jax.tree.leaves(slopes), jax.tree.leaves(scene.mechanism), strict=True)
        return found, jnp.concatenate([jnp.ravel(slope * number) for slope, number in leaves])

    return jax.vmap(one)(scene, paths, phi, speed, acceleration, scales)


graded_at_once = compiled_soon(graded, static=("keys", "loose"))


def apart(batch: Batch, rng: np.random.Generator, compiled: bool = False) -> dict[str, np.ndarray]:
    """The differences of the twins, relative to the tolerance, for every design."""
    state = batch.phi, batch.speed, batch.acceleration
    truth, keys = by_numpy(batch.scene, *state)
    condition, scales = conditions(batch, truth, rng), sizes(truth)
    paths = jax.device_get(paths_of(jax.vmap(all_loosely)(jax.tree.map(jnp.asarray, batch.scene.mechanism))))
    program = graded_at_once if compiled else graded
    with contextlib.nullcontext() if compiled else jax.disable_jit():
        (one, slopes), (two, same) = (
            jax.device_get(program(batch.scene, way, *state, scales, keys=keys, loose=loose))
            for way, loose in (({}, False), (paths, True))
        )
    over = {}
    for kind in KINDS:
        off = np.max(np.abs(two[kind] - one[kind]), -1) / scales[kind]
        over[kind] = off / (PER_CONDITION * condition[kind] + BESIDES)
    worst = np.max([condition[kind] for kind in KINDS], axis=0)
    off = np.linalg.norm(same - slopes, axis=-1) / np.linalg.norm(slopes, axis=-1)
    return over | {"gradient": off / (PER_CONDITION * worst + BESIDES)}
