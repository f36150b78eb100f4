"""An optimisation problem, compiled once: a design in, all rows of all terms in all cases out, with derivatives."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from linkjax._compile import compiled_soon
from linkjax.analysis import LIGHTEST, massless
from linkjax.design._names import DesignError, Number, changed, number
from linkjax.design._needs import Needs, needs, rows_for
from linkjax.design._terms import INITIAL, Limit, Term, at_least
from linkjax.machine import Scene
from linkjax.measures import NODES, Parts, min_margin, steady_state_margin
from linkjax.motion import Rows, watched

ASSEMBLED = 1e-3  # the least assembly margin of a design that counts as assembled
SLIGHT = 1e-6  # of what the free numbers can do: a bound so close to zero is no measure
FLYWHEEL = "flywheel_for_target_delta"  # a measure of machines without any inertia, too
RUNNING = 1e-3  # the least regime margin of one that counts as running


@dataclasses.dataclass(frozen=True)
class Variable:
    """A free number: its name, its bounds (SI, or for `optimise` texts with units), and names of others that keep their
    ratio to it."""

    name: str
    lower: float | str
    upper: float | str
    linked: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True)
class Case:
    """A case of load: numbers of the scene that differ (SI, or for `optimise` texts with units), by name."""

    name: str = ""
    changes: Mapping[str, float | str] = dataclasses.field(default_factory=dict)


class Block(NamedTuple):
    """One term in one case at one design: its rows, their slope by the variables, their angles (rad), its value."""

    vectors: Float[np.ndarray, "rows parts"]
    slope: Float[np.ndarray, "rows parts n"]
    angle: Float[np.ndarray, " rows"]
    value: float
    exists: bool = True


@dataclasses.dataclass(frozen=True)
class Kind:
    """What is known of a block beforehand. Its rows times `sign` are to be small: below `bound` times `sign` for a
    limit and for what makes a design sound; `signed` rows count by value, others by length. `own` is its measure apart
    from any bound, `effect` what the free numbers can do to it. SI."""

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

    @property
    def label(self) -> str:
        """Name, with the case where there are several."""
        return f"{self.name} ({self.case})" if self.case else self.name

    def bounded(self, bound: float) -> Kind:
        """The same with another bound, which is its measure unless it is close to zero."""
        scale = abs(bound) if abs(bound) > SLIGHT * self.effect else self.own
        return dataclasses.replace(self, bound=bound, scale=scale)


class Problem:
    """Variables, objective, limits and cases of a scene; `at(x)` evaluates a design, one compiled call.

    `maximise` asks for a large objective; `meanwhile` is called while the problem compiles. Raises
    `DesignError` where a name or a bound cannot be.
    """

    def __init__(
        self,
        scene: Scene,
        variables: Sequence[Variable],
        objective: Term,
        limits: Sequence[Limit] = (),
        cases: Sequence[Case] = (Case(),),
        maximise: bool = False,
        nodes: int = NODES,
        meanwhile: Callable[[], None] | None = None,
    ):
        self.scene, self.variables, self.cases, self.nodes = scene, tuple(variables), tuple(cases), nodes
        check(self.variables)
        self.numbers = [number(scene, v.name) for v in self.variables]
        self.lower = np.asarray([v.lower for v in self.variables], float)
        self.upper = np.asarray([v.upper for v in self.variables], float)
        self.start = np.asarray([float(at.read(scene)) for at in self.numbers])
        self._ties = [_linked(scene, v, at) for v, at in zip(self.variables, self.numbers, strict=True)]
        goal = Limit(objective, "at least" if maximise else "at most", 0.0, objective.name)
        self.asked: list[Limit] = [goal, *limits]
        self._true_motion, self._assembled = False, len(self.asked)
        self._shapes()  # learns whether the true motion is needed
        if self._true_motion:
            self._check_moves()
        taken = {limit.name for limit in limits}
        needed = [(min_margin, ASSEMBLED), *([(steady_state_margin, RUNNING)] if self._true_motion else [])]
        for margin, least in needed:
            name = f"{margin.name} at all" if margin.name in taken else margin.name
            self.asked.append(at_least(margin, least, name=name))
        self._kept = self._shapes()
        sizes = [
            (v.size, v.size * self.start.size, a.size, 1) for v, a in ((r.vectors, r.angle) for r, _ in self._kept)
        ]
        self._ends = np.cumsum([size for block in sizes for size in block])
        self._scene, self._scene_of = ravel_pytree(scene)  # one array goes in faster than fifty
        self._run = compiled_soon(self._outputs)
        self._run.ahead(self._scene, jnp.asarray(self.start))
        if meanwhile is not None:
            meanwhile()
        self.evaluations = 0
        self.first = self.at(self.start)
        self.kinds = self._kinds(len(limits))

    def design(self, x: Array | np.ndarray) -> Scene:
        """The scene with the variables at `x` (SI); differentiable."""
        return self._place(self.scene, jnp.asarray(x))

    def at(self, x: np.ndarray) -> list[Block]:
        """Everything at one design, in the order of `kinds`: one evaluation."""
        self.evaluations += 1
        *found, ratios = np.split(np.asarray(self._run(self._scene, jnp.asarray(x))), self._ends)
        shapes = [rows.vectors.shape for rows, _ in self._kept]
        blocks = [
            Block(found[4 * i].reshape(shape), found[4 * i + 1].reshape((*shape, -1)), found[4 * i + 2],
                  float(found[4 * i + 3][0]))
            for i, shape in enumerate(shapes)
        ]  # fmt: skip
        return self._marked(blocks, ratios)

    def _marked(self, blocks: list[Block], inertia_ratios: np.ndarray) -> list[Block]:
        """The blocks, marked where they have no value because a machine cannot be assembled or has no actual motion. The
        conditions are those of an analysis."""
        count, found = len(self.asked), []
        for case, ratio in enumerate(inertia_ratios):
            own = blocks[case * count : (case + 1) * count]
            margins = [block.value for block in own[self._assembled :]]
            if not margins[0] > 0:
                missing = Needs.ASSEMBLY
            elif not (all(margin > 0 for margin in margins) and ratio > LIGHTEST):
                missing = Needs.MOTION
            else:
                found += own
                continue
            found += [block._replace(exists=need < missing) for block, need in zip(own, self._needs, strict=True)]
        return found

    @functools.cached_property
    def _needs(self) -> list[Needs]:
        """What every term needs; found only when some machine has no value of one."""
        return [needs(limit, self.scene, self.nodes) for limit in self.asked]

    def _place(self, scene: Scene, x: Array) -> Scene:
        pairs: list[tuple[Number, Any]] = []
        for i, (at, ties) in enumerate(zip(self.numbers, self._ties, strict=True)):
            pairs += [(at, x[i]), *((other, ratio * x[i]) for other, ratio in ties)]
        return changed(scene, pairs)

    def _rows(self, scene: Scene, x: Array) -> tuple[list[tuple[Rows, Array]], list[Array]]:
        """Rows and exact value of every term, case by case; and of every case the smallest inertia ratio, or one where
        the actual motion is not needed."""
        found, ratios = [], []
        with watched() as seen:
            for case in self.cases:
                parts = Parts(changed(self._place(scene, x), case.changes), self.nodes)
                found += [rows_for(limit, parts) for limit in self.asked]
                ratios.append(parts.steady.min_inertia_ratio if self._true_motion else jnp.ones(()))
        self._true_motion |= bool(seen)
        return found, ratios

    def values(self, x: Array) -> Float[Array, " blocks"]:
        """The value (SI) of everything at one design, in the order of `kinds`; to be traced, and not counted."""
        return jnp.stack([value for _, value in self._rows(self.scene, x)[0]])

    def _shapes(self) -> list[tuple[Rows, Any]]:
        """The shapes of `_rows`; traced anew, for what is asked may have grown."""
        return jax.eval_shape(lambda scene, x: self._rows(scene, x)[0], self.scene, jnp.asarray(self.start))

    def _outputs(self, numbers: Array, x: Array) -> Array:
        """Rows, slopes, angles and values of everything asked, case by case, in one array: one transfer. The scene
        comes as its numbers in a row."""
        scene = self._scene_of(numbers)

        def vectors(x):
            found, ratios = self._rows(scene, x)
            every = [rows.vectors for rows, _ in found]
            return every, (every, [rows.angle for rows, _ in found], [value for _, value in found], ratios)

        slopes, (every, angles, values, ratios) = jax.jacfwd(vectors, has_aux=True)(x)
        slopes = [jnp.nan_to_num(slope, posinf=0.0, neginf=0.0) for slope in slopes]  # none where there is no value
        parts = [part.ravel() for each in zip(every, slopes, angles, values, strict=True) for part in each]
        return jnp.concatenate([*parts, jnp.stack(ratios)])

    def rescale(self, value: float) -> None:
        """Measure the objective by another value (SI)."""
        self.kinds = [dataclasses.replace(k, scale=value) if k.role == "objective" else k for k in self.kinds]

    def _check_initial(self, blocks: list[Block]) -> None:
        """Raise `DesignError` where a bound is the value of the original machine, and that does not exist."""
        count = len(self.asked)
        for i, block in enumerate(blocks):
            limit, first = self.asked[i % count], i - i % count
            if limit.bound != INITIAL or (block.exists and np.isfinite(block.value)):
                continue
            margins = [each.value for each in blocks[first + self._assembled : first + count]]
            if block.exists:
                why = f"it is {block.value}"
            elif not margins[0] > 0:
                why = f"the original machine cannot be assembled, its smallest assembly margin is {margins[0]:.3g}"
            elif not all(margin > 0 for margin in margins):
                why = f"the original machine has no steady-state motion, its steady-state margin is {margins[1]:.3g}"
            else:
                why = "the original machine has no actual motion, its reduced inertia vanishes at a crank angle"
            raise DesignError(limit.name, f"has no initial value: {why}", "write a number as its bound")

    def _check_moves(self) -> None:
        """Raise `DesignError` for a measure of the actual motion where there is none whatever the design."""
        scene = self.scene
        names = [name for v in self.variables for name in (v.name, *(v.linked or ()))]
        names += [name for case in self.cases for name in case.changes]
        heavy = any(word in name for name in names for word in ("mass", "inertia", "density", "area", "weights"))
        lifeless = massless(scene) and not heavy and not scene.mechanism.prescribed
        if not (scene.constant_speed or lifeless):
            return
        asked = [limit for limit in self.asked if limit.name != FLYWHEEL and self._of_motion(limit)]
        if asked:
            why, remedy = "nothing has a mass", "give masses, or a flywheel"
            if scene.constant_speed:
                why, remedy = "the scene asks for constant speed", "delete constant_speed"
            problem = f"belongs to the actual motion, but {why}"
            raise DesignError(asked[0].name, problem, f"{remedy}, or name a measure at constant speed")

    def _of_motion(self, limit: Limit) -> bool:
        """Whether a limit asks for the true motion."""
        with watched() as seen:
            jax.eval_shape(lambda scene: rows_for(limit, Parts(scene, self.nodes)), self.scene)
        return bool(seen)

    def _kinds(self, limits: int) -> list[Kind]:
        """Bounds and scales, from values and slopes at the start."""
        found, span = [], self.upper - self.lower
        self._check_initial(self.first)
        for i, (block, (rows, _)) in enumerate(zip(self.first, self._kept, strict=True)):
            j = i % len(self.asked)
            limit, case = self.asked[j], self.cases[i // len(self.asked)].name
            role = "objective" if j == 0 else "limit" if j <= limits else "sound"
            bound = block.value if limit.bound == INITIAL else float(limit.bound)
            sign = 1.0 if limit.sense == "at most" else -1.0
            sizes = block.vectors[:, 0] * sign if rows.signed else np.linalg.norm(block.vectors, axis=1)
            effect = float(np.max(np.abs(block.slope[int(np.argmax(sizes))] * span)))
            own = max(_finite(block.value), effect) or 1.0  # a value that happens to be small is no measure
            kind = Kind(limit.name, case, limit.term.unit, role, rows.signed, sign, 0.0, own, own, effect)
            found.append(kind if role == "objective" else kind.bounded(bound))
        common = max(kind.scale for kind in found if kind.role == "objective")  # the worst case counts, by one measure
        return [dataclasses.replace(kind, scale=common) if kind.role == "objective" else kind for kind in found]


def _finite(values: Any) -> float:
    """The largest magnitude of what is finite."""
    return float(np.max(np.abs(np.nan_to_num(values, posinf=0.0, neginf=0.0)), initial=0.0))


def _linked(scene: Scene, variable: Variable, at: Number) -> list[tuple[Number, float]]:
    found, value = [], float(at.read(scene))
    for name in variable.linked:
        if value == 0:
            raise DesignError(variable.name, f"is zero, so {name} has no ratio to it", "start from another value")
        other = number(scene, name)
        found.append((other, float(other.read(scene)) / value))
    return found


def check(variables: Sequence[Variable]) -> None:
    """Raise `DesignError` where nothing is free, a number is freed twice, or bounds are none."""
    if not variables:
        raise DesignError("free", "nothing is free", 'name a number, e.g. {"flywheel.inertia": (0, 40)}')
    seen: set[str] = set()
    for v in variables:
        for name in (v.name, *v.linked):
            if name in seen:
                raise DesignError(name, "is freed twice", "name every number once, or tie it to one other")
            seen.add(name)
        low, high = float(v.lower), float(v.upper)
        if not np.isfinite([low, high]).all() or not low < high:
            problem = f"its bounds are {low:g} and {high:g}"
            raise DesignError(v.name, problem, "give two finite bounds, the lower first")
