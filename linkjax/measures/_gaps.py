"""How far a machine is from its singular positions: least assembly margins and transmission angles, of all groups or of
one."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array

from linkjax._numerics import wrapped
from linkjax.kinematics import Least, named_groups
from linkjax.machine import Scene
from linkjax.measures._parts import Parts
from linkjax.mechanism import Mechanism, StructureError
from linkjax.motion import At, Regime, Rows, Summits, Wanted, by_node


def margins(of: Parts, group: str = "") -> Rows:
    """Smallest signed assembly margins over the continuous cycle, of a group or all; negative: cannot be assembled."""
    limits = of.margins
    chosen = [limits.get(group, {})] if group else limits.values()
    found = [least for sides in chosen for least in sides.values()]
    found = found or [Least(jnp.ones(()), jnp.zeros(()))]
    return Rows(jnp.stack([each.value for each in found])[:, None], jnp.stack([each.angle for each in found]), True)


def limited_groups(scene: Scene) -> tuple[str, ...]:
    """The groups that have singular positions."""
    return tuple(name for name, group in named_groups(scene.mechanism).items() if group.singular_positions())


def no_transmission_angle(mechanism: Mechanism) -> bool:
    """Whether all groups are of higher class, which have no transmission angle."""
    driver, *groups = (group.numerical() for group in mechanism.groups)
    return all(groups) and (driver or len(groups) > 0)


def transmission_angles(of: Parts, group: str = "") -> Wanted:
    """Smallest transmission angle over the cycle, of a group or of all, where an obtuse angle counts as its supplement:
    90 degrees is best, and zero is a singular position. Groups of higher class have none; raises `StructureError` if
    there are no other groups."""
    if no_transmission_angle(of.scene.mechanism):
        problem = "does not exist for this machine: all its groups are of higher class"
        raise StructureError("min_transmission_angle", problem, "delete it")

    def off_square(regime: Regime, at: At) -> Array:
        angles = [at.transmission[group]] if group else list(at.transmission.values())
        rows = [angle - jnp.pi / 2 for angle in angles] or [jnp.zeros_like(at.place.phi)]
        return jnp.stack(rows)[:, None]

    at_nodes = by_node.function(of.grid, off_square(of.constant_speed, of.constant_speed.at(of.at.place, of.at.sample)))
    nodes = jnp.broadcast_to(jax.lax.stop_gradient(of.grid.nodes), (at_nodes.shape[0], *of.grid.nodes.shape))

    def finished(found: Summits) -> Rows:
        vectors = jnp.concatenate([at_nodes.ravel(), found.vectors.ravel()])[:, None]
        angle = jnp.concatenate([wrapped(nodes, of.grid.length).ravel(), found.angle.ravel()])
        both = jnp.concatenate([jnp.pi / 2 - vectors, jnp.pi / 2 + vectors])  # acute or obtuse: no kink between
        return Rows(both, jnp.concatenate([angle, angle]), signed=True)

    return Wanted(of.constant_speed, off_square, at_nodes, finished, "gaps")
