"""What a problem computes at one design, a block for every term and case, and its fixed properties."""

from __future__ import annotations

import dataclasses
import math
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

SLIGHT = 1e-6  # of the effect of the design variables: a bound so close to zero is not used as scale


class Block(NamedTuple):
    """One term in one case at one design: its rows, their derivatives with respect to the variables, their crank angles
    (rad), its value, whether rows count by value, and whether the value exists."""

    vectors: Float[np.ndarray, "rows parts"]
    slope: Float[np.ndarray, "rows parts n"]
    angle: Float[np.ndarray, " rows"]
    value: float
    signed: bool
    exists: bool = True


@dataclasses.dataclass(frozen=True)
class Kind:
    """The fixed properties of a block, in SI. Its rows times `sign` are minimised, or kept below `bound` times `sign`
    for a constraint ("limit") and for the margins of a design ("sound"). `signed` rows count by value, others by
    length. `own` is its scale without a bound, `effect` its largest change by the variables.

    The value of a `square` is the square of the length of its row, a sum of squares. The solvers see the length, as the
    unit of `scale`, `own` and `effect`; values, bounds and multipliers are those of the square.
    """

    name: str
    case: str
    unit: str
    role: Literal["objective", "limit", "sound"]
    signed: bool
    sign: float
    bound: float
    scale: float
    own: float = 1.0
    effect: float = 0.0
    square: bool = False

    @property
    def label(self) -> str:
        """Name, with the case if there are several."""
        return f"{self.name} ({self.case})" if self.case else self.name

    @property
    def level(self) -> float:
        """The bound of the rows."""
        return self.size(self.bound)

    def bounded(self, bound: float) -> Kind:
        """The same with another bound, which is also the scale unless it is close to zero."""
        size = abs(self.size(bound))
        return dataclasses.replace(self, bound=bound, scale=size if size > SLIGHT * self.effect else self.own)

    def size(self, value: float) -> float:
        """The size of the largest row for a value of the term."""
        return math.sqrt(max(value, 0.0)) if self.square else value

    def value(self, scaled: float) -> float:
        """The value of the term for a scaled size of its largest row."""
        size = scaled * self.scale * (self.sign if self.signed else 1.0)
        return size * size if self.square else size

    def rate(self, size: float) -> float:
        """The change of the value of the term with the size of its largest row."""
        return 2 * size if self.square else 1.0
