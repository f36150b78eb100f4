"""A motion law composed of moves: from value to value over given crank angles, each with its shape."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Literal, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from linkjax._numerics import wrapped
from linkjax._types import as_float, known
from linkjax.groups._law import AbstractLaw, Moved, Stops
from linkjax.groups._law_shapes import (
    Blend,
    Rise,
    cycloidal,
    modified_sine,
    modified_trapezoid,
    polynomial_345,
    polynomial_4567,
    trapezoidal,
)

Shape = Literal[
    "3-4-5", "4-5-6-7", "cycloidal", "modified_sine", "modified_trapezoid", "trapezoidal", "constant_speed", "dwell"
]
POLYNOMIAL = {"3-4-5": polynomial_345, "4-5-6-7": polynomial_4567}  # these may begin and end with a speed
PLAIN = {"cycloidal": cycloidal, "modified_sine": modified_sine, "modified_trapezoid": modified_trapezoid}
INSIDE = {"modified_sine": (1 / 8, 7 / 8), "modified_trapezoid": (1 / 8, 3 / 8, 5 / 8, 7 / 8)}  # kinks
RAMP = 1 / 3  # of a trapezoidal speed
SAME = 1e-9  # relative: numbers of a law that agree
SHORTEST = 1e-6  # of the cycle: the least angle of a move
BESIDE = 0.03  # of a move: beside a stop


class Move(eqx.Module):
    """A move `to` a value (rad or m) `over` a crank angle (rad), of a `shape`.

    Shapes: the polynomials "3-4-5" and "4-5-6-7", "cycloidal", "modified_sine", "modified_trapezoid", "trapezoidal"
    (speed), "constant_speed", and "dwell", which keeps the value. `ramp` is the part of the angle in which a
    trapezoidal speed increases, and again decreases: above zero, up to one half; one third if None.

    A move begins and ends with speed zero. Only a polynomial next to a move of constant speed has that speed there, so
    that the speed of a law never jumps. Raises `ValueError` for an unknown shape and a wrong angle or ramp.
    """

    to: Array | None = eqx.field(converter=as_float, default=None)
    over: Array | None = eqx.field(converter=as_float, default=None)
    shape: Shape = eqx.field(static=True, default="3-4-5")
    ramp: Array | None = eqx.field(converter=as_float, default=None)

    def __check_init__(self):
        if self.shape not in get_args(Shape):
            raise ValueError(f"shape of a move is {self.shape!r}; write one of {', '.join(get_args(Shape))}")
        over, ramp = known(self.over), known(self.ramp)
        if over is not None and not np.all(np.isfinite(over) & (over > 0)):
            raise ValueError(f"crank angle of a move is {over} rad; write an angle above zero")
        if ramp is not None and not np.all((ramp > 0) & (ramp <= 0.5)):
            raise ValueError(f"ramp of a move is {ramp}; write a part of its angle above zero, up to 0.5")
        if self.ramp is not None and self.shape != "trapezoidal":
            raise ValueError(f'ramp of a move of shape "{self.shape}" has no effect; delete it')

    def kinks(self) -> tuple[Any, ...]:
        """Where a derivative jumps inside of the move, as parts of its angle."""
        if self.shape != "trapezoidal":
            return INSIDE.get(self.shape, ())
        ramp = RAMP if self.ramp is None else self.ramp
        return (ramp, 1 - ramp)


class Moves(AbstractLaw):
    """A motion law composed of `moves` that begin at the value `start` (rad or m) at crank angle zero.

    `cycle` is the crank angle (rad) after which it repeats. So that this holds for every design, the last move takes
    the rest of the cycle, and the last move that is no dwell returns to `start`: there `over` and `to` are omitted, or
    given with just these values. All other angles and values are design variables.

    Raises `ValueError` if an angle or value is missing, the moves do not fit the cycle or do not return, a dwell
    changes the value, nothing moves, or the speed would jump beside a move of constant speed.
    """

    start: Array = eqx.field(converter=as_float)
    moves: tuple[Move, ...] = eqx.field(converter=tuple)
    cycle: float = eqx.field(static=True, converter=float)

    def __init__(self, start: Any, moves: Iterable[Move], cycle: float = 2 * math.pi):
        self.start, self.cycle = as_float(start), float(cycle)
        self.moves = _closed(self.start, tuple(moves), self.cycle)

    def period(self):
        return self.cycle

    def _angles(self) -> Array:
        """Crank angles at which the moves begin, and the end of the cycle."""
        least = SHORTEST * self.cycle
        steps = [jnp.maximum(move.over, least) for move in self.moves[:-1] if move.over is not None]
        begins = jnp.concatenate([jnp.zeros(1), jnp.cumsum(jnp.stack(steps))])
        return jnp.concatenate([begins, jnp.maximum(begins[-1:] + least, self.cycle)])

    def _values(self) -> Array:
        """Values at these angles."""
        values, last = [self.start], _last(self.moves)
        for number, move in enumerate(self.moves):
            here = self.start if number == last else values[-1] if move.to is None else move.to
            values.append(here)
        return jnp.stack(values)

    def stops(self):
        angles, widths = self._angles(), jnp.diff(self._angles())
        count, goes = len(self.moves), [i for i, move in enumerate(self.moves) if move.shape != "dwell"]
        found = []
        for place, number in enumerate(goes):
            after = goes[(place + 1) % len(goes)]
            if "constant_speed" in (self.moves[number].shape, self.moves[after].shape):
                continue
            rest = (after - number - 1) % count
            end = angles[number + 1] + sum((widths[(number + 1 + i) % count] for i in range(rest)), 0.0)
            found.append((angles[number + 1], end, BESIDE * jnp.minimum(widths[number], widths[after])))
        if not found:
            return None
        return Stops(*(jnp.stack(part) for part in zip(*found, strict=True)))

    def rests(self):
        return any(move.shape == "dwell" for move in self.moves)

    def jumps(self):
        return any(move.shape == "trapezoidal" for move in self.moves)

    def breaks(self):
        angles, found = self._angles(), []
        for number, move in enumerate(self.moves):
            width = angles[number + 1] - angles[number]
            found += [angles[number], *(angles[number] + part * width for part in move.kinks())]
        return tuple(found)

    def at(self, phi):
        angles, values = self._angles(), self._values()
        widths, heights = jnp.diff(angles), jnp.diff(values)
        constant = jnp.asarray([move.shape == "constant_speed" for move in self.moves])
        steady = jnp.where(constant, heights / widths, 0.0)
        speeds = steady + jnp.roll(steady, 1)  # at the beginning of each move; two of constant speed never meet
        x = wrapped(phi, self.cycle)
        i = jnp.clip(jnp.searchsorted(angles, x, side="right") - 1, 0, len(self.moves) - 1)
        width, height = widths[i], heights[i]
        u = (x - angles[i]) / width
        ends = (width * speeds[i], width * speeds[(i + 1) % len(self.moves)])
        ramps = jnp.stack([as_float(RAMP if move.ramp is None else move.ramp) for move in self.moves])
        found = Rise(*(jnp.zeros_like(u) for _ in range(3)))
        for shape in dict.fromkeys(move.shape for move in self.moves):
            mine = jnp.asarray([move.shape == shape for move in self.moves])[i]
            part = _part(shape, u, height, ends, ramps[i])
            found = Rise(*(jnp.where(mine, new, old) for new, old in zip(part, found, strict=True)))
        return Moved(values[i] + found.value, found.d / width, found.dd / width**2)


def _part(shape: str, u: Array, height: Array, ends: tuple[Array, Array], ramp: Array) -> Rise:
    """The change of the value within a move, with its derivatives with respect to `u`."""
    none = jnp.zeros_like(u)
    if shape == "dwell":
        return Rise(none, none, none)
    if shape == "constant_speed":
        return Rise(height * u, jnp.broadcast_to(height, u.shape), none)
    if shape in POLYNOMIAL:
        blend: Blend = POLYNOMIAL[shape](u)
        return Rise(*(height * p + ends[0] * a + ends[1] * b for p, a, b in zip(*blend, strict=True)))
    rise = trapezoidal(u, ramp) if shape == "trapezoidal" else PLAIN[shape](u)
    return Rise(*(height * p for p in rise))


def _last(moves: tuple[Move, ...]) -> int:
    """The number of the last move that is no dwell."""
    return max((number for number, move in enumerate(moves) if move.shape != "dwell"), default=-1)


def _closed(start: Array, moves: tuple[Move, ...], cycle: float) -> tuple[Move, ...]:
    """The moves without the numbers that follow from the others; raises `ValueError` where they do not fit."""
    last, value = _last(moves), start
    if last < 0:
        raise ValueError("no move of a law changes the value, so nothing moves; add moves to other values")
    for number, move in enumerate(moves):
        _check_angle(moves, number, cycle)
        _check_neighbours(moves, number)
        name = f"move {number + 1} of a law"
        if move.shape == "dwell":
            if not _agree(move.to, value):
                raise ValueError(f"{name} is a dwell to {move.to}, but the value before is {value}; omit its `to`")
        elif number == last:
            if not _agree(move.to, start):
                raise ValueError(f"{name} ends at {move.to}, not at the start {start}; return there, or omit its `to`")
            value = start
        elif move.to is None:
            raise ValueError(f"{name} has no value; write the value `to` which it moves")
        else:
            value = move.to
    between = [move.to for move in moves[:last] if move.shape != "dwell"]
    if all(known(to) is not None and _agree(to, start) for to in between):
        raise ValueError("all values of a law are the same, so nothing moves; write values that differ")
    return tuple(
        Move(
            None if number == last or move.shape == "dwell" else move.to,
            None if number == len(moves) - 1 else move.over,
            move.shape,
            move.ramp,
        )
        for number, move in enumerate(moves)
    )


def _check_angle(moves: tuple[Move, ...], number: int, cycle: float) -> None:
    """Raise `ValueError` unless the angle of a move is given, and those of all moves fill the cycle."""
    move, rest = moves[number], number == len(moves) - 1
    if move.over is None and not rest:
        raise ValueError(f"move {number + 1} of a law has no crank angle; write the angle `over` which it moves")
    angles = [known(each.over) for each in moves[:-1]]
    if not rest or any(angle is None for angle in angles):
        return
    left = cycle - sum(float(angle) for angle in angles if angle is not None and np.ndim(angle) == 0)
    over = known(move.over)
    if left <= 0 or (over is not None and np.any(abs(over - left) > SAME * cycle)):
        problem = f"the last move of a law has the rest of its cycle, {math.degrees(left):.9g} deg"
        raise ValueError(f"{problem}; omit its `over`, change the others, or set the cycle")


def _check_neighbours(moves: tuple[Move, ...], number: int) -> None:
    """Raise `ValueError` if the speed jumps at the end of a move."""
    one, other = moves[number], moves[(number + 1) % len(moves)]
    shapes = {one.shape, other.shape}
    if "constant_speed" in shapes and not (shapes & set(POLYNOMIAL) and len(shapes) == 2):
        problem = f'after move {number + 1} of a law ("{one.shape}") the speed jumps to that of "{other.shape}"'
        raise ValueError(f'{problem}; write a "3-4-5" or "4-5-6-7" move on both sides of a constant speed')


def _agree(given: Array | None, wanted: Array) -> bool:
    """Whether a value that may be omitted is the one that it must be, as far as known."""
    one, other = known(given), known(wanted)
    return one is None or other is None or bool(np.all(np.abs(one - other) <= SAME * (1 + np.abs(other))))
