"""Ready-made objectives of synthesis: a path through points, an angle as a function of the crank angle, positions of a
link. Their crank angles are given, given up to one free offset, or all free, as own numbers.

Source: Norton, Design of Machinery, 2012, ch. 3 and 5: path generation, function generation, motion generation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._numerics import wrapped
from linkjax._units import nearest
from linkjax.design._names import DesignError, amount
from linkjax.design._squares import squares, weights_of
from linkjax.design._terms import Term
from linkjax.design._variables import OWN, Variable, own_of
from linkjax.groups import FRAME
from linkjax.kinematics import Pose
from linkjax.machine import Scene
from linkjax.measures import Parts
from linkjax.topology import origins, owners

ANGLE = OWN + "angle"  # free crank angles are own.angle1, own.angle2, …
Quantities = Any  # a list or an array of numbers (SI) or strings with units
Angles = Any  # the same, the beginning of the names of own numbers, or None


def path_error(
    point: str, points: Quantities, angles: Angles = None, *,
    start: str | None = None, weights: Any = None,
) -> Term:  # fmt: skip
    """The sum of the squares of the distances (m²) of a point of a link from wanted points, one after another.

    `points` are (x, y) in m or strings with units, shape (n, 2), and `angles` the crank angles, in rad or strings
    ("30 deg"). Without `angles` they are free: own numbers `own.angle1`, `own.angle2`, …, each within half a cycle of
    an even distribution, unless they are among the design variables; a string replaces `own.angle`. `start`, the name
    of an own number, is added to all given angles, free within half a cycle of zero. Every square is multiplied by its
    weight, shape (n,). Raises `DesignError` for lengths that differ, values that are not finite, and unknown names.
    """
    name = "path_error"
    wanted = _table(points, ("m", "m"), f"{name}: points", '[["20 mm", "10 mm"], …]')
    timing = _timing(name, angles, start, len(wanted))

    def residuals(of: Parts) -> Array:
        at = _poses(of, timing.angles(of)).points[point].r
        return jnp.stack([at.x, at.y], axis=-1)[: len(wanted)] - wanted

    def wants(scene: Scene) -> list[Variable]:
        _check_point(scene, name, point)
        return timing.wants(scene)

    return squares(name, "m^2", _weighted(residuals, weights, len(wanted), name), wants)


def function_error(
    link: str, angles: Angles, values: Quantities, *,
    start: str | None = None, offset: str | None = None, weights: Any = None,
) -> Term:  # fmt: skip
    """The sum of the squares of the differences (rad²) of the angle of a link, from the x axis to its own axis, and
    wanted values, in rad or strings with units, shape (n,). Differences are within half a turn.

    `offset` is the name of an own number that is added to all values, free within half a turn of zero; `angles`,
    `start`, `weights` and errors are as in `path_error`.
    """
    name = "function_error"
    wanted = _table([[each] for each in _listed(values, f"{name}: values")], ("rad",), f"{name}: values", '["30 deg"]')
    timing = _timing(name, angles, start, len(wanted))
    if offset is not None:
        _check_own_name(name, "offset", offset)

    def residuals(of: Parts) -> Array:
        more = 0.0 if offset is None else own_of(of)[offset.removeprefix(OWN)]
        return _turned(_poses(of, timing.angles(of)), link, wanted[:, 0] + more)[:, None]

    def wants(scene: Scene) -> list[Variable]:
        _check_link(scene, name, link)
        return [*timing.wants(scene), *([] if offset is None else [_about_zero(offset, 2 * math.pi)])]

    return squares(name, "rad^2", _weighted(residuals, weights, len(wanted), name), wants)


def position_error(
    link: str, positions: Quantities, angles: Angles = None, *, point: str | None = None,
    length: float | str | None = None, start: str | None = None, weights: Any = None,
) -> Term:  # fmt: skip
    """The sum of the squares (m²) of the differences of a link from wanted positions (x, y, angle), shape (n, 3): of
    the coordinates of `point`, by default the origin of the link's axes, and of its angle times `length`.

    By default `length` is the largest distance between two of the wanted places. `angles`, `start`, `weights` and
    errors are as in `path_error`; differences of angles are within half a turn.
    """
    name = "position_error"
    wanted = _table(positions, ("m", "m", "rad"), f"{name}: positions", '[["20 mm", "10 mm", "30 deg"], …]')
    places = wanted[:, :2]
    far = float(np.max(np.linalg.norm(places[:, None] - places[None], axis=2)))
    long = far if length is None else amount(length, "m", f"{name}: length")
    if not long > 0:
        raise DesignError(f"{name}: length", f"is {long:g}", 'write the length that scales the angle, e.g. "100 mm"')
    timing = _timing(name, angles, start, len(wanted))

    def residuals(of: Parts) -> Array:
        here = _poses(of, timing.angles(of))
        at = here.points[_point_of(of.scene, link, point)].r
        away = jnp.stack([at.x, at.y], axis=-1)[: len(wanted)] - places
        return jnp.concatenate([away, long * _turned(here, link, wanted[:, 2])[:, None]], axis=1)

    def wants(scene: Scene) -> list[Variable]:
        _check_link(scene, name, link)
        if point is not None:
            _check_point(scene, name, point)
            owner = _owners(scene)[point]
            if owner != link and point not in scene.mechanism.links[link].pins:
                raise DesignError(f"{name}: {point}", f"is a point of {owner!r}, not of {link!r}", "name its own link")
        return timing.wants(scene)

    return squares(name, "m^2", _weighted(residuals, weights, len(wanted), name), wants)


class _Timing(NamedTuple):
    """Crank angles (rad) of a design, and the own numbers that they need."""

    angles: Callable[[Parts], Array]
    wants: Callable[[Scene], list[Variable]]


def _timing(name: str, angles: Angles, start: str | None, count: int) -> _Timing:
    """The crank angles of so many residuals: given, given with a free start, or all free."""
    if start is not None:
        _check_own_name(name, "start", start)
    if angles is None or isinstance(angles, str):
        prefix = ANGLE if angles is None else angles
        _check_own_name(name, "angles", prefix)
        if start is not None:
            raise DesignError(f"{name}: start", "is given, but all crank angles are free", "delete it or give `angles`")
        names = [f"{prefix}{i + 1}" for i in range(count)]
        return _Timing(
            lambda of: jnp.stack([own_of(of)[each.removeprefix(OWN)] for each in names]),
            lambda scene: [
                Variable(each, mid - 0.5 * scene.cycle, mid + 0.5 * scene.cycle, (), mid, "rad")
                for each, mid in zip(names, np.arange(count) * (scene.cycle / count), strict=True)
            ],
        )
    given = [amount(each, "rad", f"{name}: angles[{i}]") for i, each in enumerate(angles)]
    if len(given) != count:
        problem = f"has {len(given)} crank angles for {count} wanted values"
        raise DesignError(f"{name}: angles", problem, "write one angle for each value")
    fixed = jnp.asarray(given, dtype=float)
    return _Timing(
        lambda of: fixed if start is None else fixed + own_of(of)[start.removeprefix(OWN)],
        lambda scene: [] if start is None else [_about_zero(start, scene.cycle)],
    )


def _about_zero(name: str, period: float) -> Variable:
    return Variable(name, -0.5 * period, 0.5 * period, (), 0.0, "rad")


def _poses(of: Parts, angles: Array) -> Pose:
    """Poses at crank angles."""
    return of.machine.sample(wrapped(angles, of.scene.cycle), dynamics=False).pose


def _turned(here: Pose, link: str, wanted: Any) -> Float[Array, " n"]:
    """Angles of a link minus wanted ones, within half a turn."""
    count = len(wanted)
    u, c, s = here.links[link].u, jnp.cos(wanted), jnp.sin(wanted)
    x, y = u.x[:count], u.y[:count]
    return jnp.atan2(c * y - s * x, c * x + s * y)


def _weighted(residuals: Callable[[Parts], Array], weights: Any, count: int, name: str) -> Callable[[Parts], Array]:
    """The residuals with every row times the root of its weight."""
    if weights is None:
        return residuals
    factors = np.sqrt(weights_of(weights, f"{name}: weights"))
    if factors.shape != (count,):
        raise DesignError(f"{name}: weights", f"has shape {factors.shape}, not ({count},)", f"write {count} weights")
    return lambda of: residuals(of) * factors[:, None]


def _listed(given: Any, element: str) -> list[Any]:
    """A list of what is given."""
    if isinstance(given, str) or not hasattr(given, "__len__"):
        raise DesignError(element, f"{given!r} is not a list", "write a list")
    return list(given)


def _table(given: Any, units: tuple[str, ...], element: str, example: str) -> Float[np.ndarray, "n columns"]:
    """Rows of quantities in SI. Raises `DesignError` for none, for rows of another length, and for wrong values."""
    rows = _listed(given, element)
    if not rows:
        raise DesignError(element, "is empty", f"write e.g. {example}")
    found = np.empty((len(rows), len(units)))
    for i, row in enumerate(rows):
        if isinstance(row, str) or not hasattr(row, "__len__") or len(row) != len(units):
            raise DesignError(f"{element}[{i}]", f"{row!r} has not {len(units)} values", f"write e.g. {example}")
        for j, (each, unit) in enumerate(zip(row, units, strict=True)):
            found[i, j] = amount(each, unit, f"{element}[{i}]")
    return found


def _check_own_name(name: str, key: str, given: Any) -> None:
    if not isinstance(given, str) or not given.startswith(OWN) or not given.removeprefix(OWN).isidentifier():
        problem = f"{given!r} is not the name of an own number"
        raise DesignError(f"{name}: {key}", problem, f'write e.g. "{OWN}{key}"')


def _owners(scene: Scene) -> dict[str, str]:
    """The link of every point."""
    mechanism = scene.mechanism
    return owners(mechanism.fixed, mechanism.groups, mechanism.links)


def _check_point(scene: Scene, name: str, point: Any) -> None:
    """Raise `DesignError` for a name that is not a point of a link."""
    known = {each: link for each, link in _owners(scene).items() if link != FRAME}
    if point not in known:
        fixed = point in scene.mechanism.fixed
        problem = "is a point of the frame, which does not move" if fixed else "is not a point of the machine"
        raise DesignError(f"{name}: {point}", problem, nearest(str(point), known))


def _check_link(scene: Scene, name: str, link: Any) -> None:
    """Raise `DesignError` for a name that is not a link."""
    if link not in scene.mechanism.links:
        raise DesignError(f"{name}: {link}", "is not a link of the machine", nearest(str(link), scene.mechanism.links))


def _point_of(scene: Scene, link: str, point: str | None) -> str:
    """The named point, or the one at the origin of the axes of the link."""
    return origins(scene.mechanism.groups)[link] if point is None else point
