"""An optimisation problem, compiled once: from a design to all rows of all terms in all cases, with derivatives.

One program for a structure and a `Task`: bounds, starts, ratios of linked parameters, values of load cases and all
scene parameters are arguments. It is kept in files like an analysis, unless a term is a user-defined function.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from linkjax._batches import Whole
from linkjax._compile import compiled_soon
from linkjax.analysis import LIGHTEST, massless
from linkjax.design._kinds import Block, Kind
from linkjax.design._names import DesignError, Number, changed, in_si_of, number, numbers
from linkjax.design._needs import Needs, breaks_of, needs, rows_for
from linkjax.design._terms import INITIAL, Limit, Sense, Term, at_least, made_again
from linkjax.design._variables import OWN, Case, Own, OwnParts, Variable, check
from linkjax.machine import Names, Scene, nameless, untitled
from linkjax.measures import NODES, found_by, measure_names, min_margin, steady_state_margin
from linkjax.motion import Rows

ASSEMBLED = 1e-3  # smallest assembly margin of a design that counts as assembled
FLYWHEEL = "flywheel_for_target_delta"  # this measure also exists for machines without inertia
RUNNING = 1e-3  # smallest steady-state margin of a design that counts as running


class Outputs(NamedTuple):
    """Rows of every term in every case, their derivatives with respect to the variables, the values of the terms, and
    the smallest inertia ratio of every case (one where the actual motion is not needed)."""

    rows: list[Rows]
    slopes: list[Array]
    values: list[Array]
    ratios: list[Array]


class Task(NamedTuple):
    """What a problem computes, without its numbers: names of the variables and of the parameters linked to each, its
    terms with their senses, the parameters that each case changes, nodes of the grid per turn, and whether the actual
    motion is needed."""

    variables: tuple[str, ...]
    linked: tuple[tuple[str, ...], ...]
    asked: tuple[tuple[str | Term, Sense], ...]
    changes: tuple[tuple[str, ...], ...]
    nodes: int
    motion: bool


def _key(limit: Limit) -> tuple[str | Term, Sense]:
    """A term, by the name that determines it, and its sense."""
    return limit.term.made or limit.term, limit.sense


def _placed(task: Task, scene: Scene, x: Array, ratios: list[list[Any]]) -> Scene:
    """The scene with the variables `x` (SI), and the parameters linked to them in their ratios."""
    known, pairs = numbers(scene), []
    for i, (name, linked) in enumerate(zip(task.variables, task.linked, strict=True)):
        if name.startswith(OWN):
            continue
        pairs.append((known[name], x[i]))
        pairs += [(known[other], ratio * x[i]) for other, ratio in zip(linked, ratios[i], strict=True)]
    return changed(scene, pairs)


def _own(names: Sequence[str], x: Array) -> Own:
    """The own numbers among the variables."""
    return Own({name.removeprefix(OWN): x[i] for i, name in enumerate(names) if name.startswith(OWN)})


def _rows(
    task: Task, x: Array, scene: Scene, ratios: list[list[Any]], changes: list[list[Any]]
) -> tuple[list[tuple[Rows, Array]], list[Array]]:
    """Rows and exact value of every term, case by case; and of every case the smallest inertia ratio, or one where the
    actual motion is not needed."""
    found, light, own = [], [], _own(task.variables, x)
    limits = [Limit(made_again(term), sense, 0.0, "") for term, sense in task.asked]
    breaks = tuple(dict.fromkeys(at for limit in limits for at in breaks_of(limit.term)))
    for names, values in zip(task.changes, changes, strict=True):
        placed = _placed(task, scene, x, ratios)
        known = numbers(placed)
        pairs = [(known[name], value) for name, value in zip(names, values, strict=True)]
        parts = OwnParts(changed(placed, pairs), task.nodes, own, breaks)
        found += rows_for(limits, parts)
        light.append(parts.steady.min_inertia_ratio if task.motion else jnp.ones(()))
    return found, light


@compiled_soon(static=("task",))
def outputs(x: Array, scene: Scene, ratios: list[list[Any]], changes: list[list[Any]], task: Task) -> Outputs:
    """All terms of a problem, case by case, and their derivatives; compiled once for all numbers of a problem."""

    def vectors(x):
        found, light = _rows(task, x, scene, ratios, changes)
        return [rows.vectors for rows, _ in found], (found, light)

    slopes, (found, light) = jax.jacfwd(vectors, has_aux=True)(x)
    slopes = [jnp.nan_to_num(slope, posinf=0.0, neginf=0.0) for slope in slopes]  # zero where there is no value
    return Outputs([rows for rows, _ in found], slopes, [value for _, value in found], light)


def _program(
    task: Task, scene: Scene, ratios: list[list[Any]], changes: list[list[Any]], start: Array
) -> Callable[[Array], Outputs]:
    """The compiled function from a design to all outputs of a problem. It is compiled without the names of the machine,
    and once for all problems of this structure, unless a term is a user-defined function. That may use the names, and
    whatever else it uses may be different the next time, so that its program belongs to the problem alone."""
    names = None
    if all(isinstance(term, str) for term, _ in task.asked):
        scene, names = nameless(scene)
        task = task if names is None else _nameless(task, scene, names)
        run, ahead = (functools.partial(each, task=task) for each in (outputs, outputs.ahead))
    else:
        run = compiled_soon(lambda x, scene, ratios, changes: outputs.function(x, scene, ratios, changes, task))
        ahead = run.ahead
    given = Whole(scene), ratios, changes
    try:
        ahead(start, *given)
    except DesignError as error:
        if names is None:
            raise
        told = (names.in_text(part) for part in (error.element, error.problem, error.remedy))
        raise DesignError(*told) from error
    return lambda x: run(x, *given)


def _nameless(task: Task, scene: Scene, names: Names) -> Task:
    """The task of the scene without names."""
    own = {names.in_text(name): name for name in numbers(scene)}
    measures = [found_by(term) for term, _ in task.asked if isinstance(term, str)]
    own |= {each.name: each.without_names(scene, names).name for each in measures if each is not None}

    def each(given: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(own.get(name, name) for name in given)

    return task._replace(
        variables=each(task.variables),
        linked=tuple(each(linked) for linked in task.linked),
        asked=tuple((own.get(term, term), sense) for term, sense in task.asked if isinstance(term, str)),
        changes=tuple(each(changes) for changes in task.changes),
    )


class Problem:
    """Variables, objective, constraints and cases of a scene; `at(x)` evaluates a design in one compiled call.

    With `maximise` the objective is made large. `meanwhile` is called while the problem compiles. Raises `DesignError`
    for a wrong name or bound.
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
        self.numbers = [v.number(scene) for v in self.variables]
        self.lower = np.asarray([v.lower for v in self.variables], float)
        self.upper = np.asarray([v.upper for v in self.variables], float)
        self.start = np.asarray([float(at.read(scene)) for at in self.numbers])
        self._ties = [_linked(scene, v, at) for v, at in zip(self.variables, self.numbers, strict=True)]
        goal = Limit(objective, "at least" if maximise else "at most", 0.0, objective.name)
        self.asked: list[Limit] = [goal, *limits]
        self._assembled = len(self.asked)
        own = _own([v.name for v in self.variables], jnp.asarray(self.start))
        self._needs = [needs(limit, scene, nodes, own) for limit in self.asked]
        _check_used(own)
        self._true_motion = Needs.MOTION in self._needs
        if self._true_motion:
            self._check_moves()
        taken = {limit.name for limit in limits}
        margins = [(min_margin, ASSEMBLED), *([(steady_state_margin, RUNNING)] if self._true_motion else [])]
        for margin, least in margins:
            name = f"{margin.name} at all" if margin.name in taken else margin.name
            self.asked.append(at_least(margin, least, name=name))
            self._needs.append(needs(self.asked[-1], scene, nodes, own))
        self._task = Task(
            tuple(v.name for v in self.variables),
            tuple(v.linked for v in self.variables),
            tuple(_key(limit) for limit in self.asked),
            tuple(tuple(case.changes) for case in self.cases),
            nodes,
            self._true_motion,
        )
        values = [[in_si_of(scene, *pair) for pair in case.changes.items()] for case in self.cases]
        ratios = [[ratio for _, ratio in ties] for ties in self._ties]
        self._given = untitled(scene), ratios, values
        self._run = _program(self._task, *self._given, jnp.asarray(self.start))
        if meanwhile is not None:
            meanwhile()
        self.evaluations = 0
        self.first = self.at(self.start)
        self.kinds = self._kinds(len(limits))

    def design(self, x: Array | np.ndarray) -> Scene:
        """The scene with the variables `x` (SI); differentiable."""
        _, ratios, _ = self._given
        return _placed(self._task, self.scene, jnp.asarray(x), ratios)

    def at(self, x: np.ndarray) -> list[Block]:
        """All blocks of one design, in the order of `kinds`: one evaluation."""
        self.evaluations += 1
        found = jax.device_get(self._run(jnp.asarray(x)))
        blocks = [
            Block(rows.vectors, slope, rows.angle, float(value), rows.signed)
            for rows, slope, value in zip(found.rows, found.slopes, found.values, strict=True)
        ]
        return self._marked(blocks, found.ratios)

    def _marked(self, blocks: list[Block], inertia_ratios: Sequence[Any]) -> list[Block]:
        """The blocks, with `exists` false for terms without a value: the machine cannot be assembled, or has no actual
        motion. The conditions are those of an analysis."""
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

    def values(self, x: Array) -> Float[Array, " blocks"]:
        """The values (SI) of all blocks of one design, in the order of `kinds`; to be traced, not counted."""
        _, ratios, changes = self._given
        return jnp.stack([value for _, value in _rows(self._task, x, self.scene, ratios, changes)[0]])

    def rescale(self, value: float) -> None:
        """Change the scale of the objective (SI)."""
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
        """Raise `DesignError` for a measure of the actual motion in a scene that has none."""
        scene = self.scene
        names = [name for v in self.variables for name in (v.name, *(v.linked or ()))]
        names += [name for case in self.cases for name in case.changes]
        heavy = any(word in name for name in names for word in ("mass", "inertia", "density", "area", "weights"))
        lifeless = massless(scene) and not heavy and not scene.mechanism.prescribed
        if not (scene.constant_speed or lifeless):
            return
        pairs = zip(self.asked, self._needs, strict=True)
        asked = [limit for limit, need in pairs if limit.name != FLYWHEEL and need is Needs.MOTION]
        if asked:
            why, remedy = "the machine has no mass", "give masses or a flywheel"
            if scene.constant_speed:
                why, remedy = "the scene is for constant speed", "delete constant_speed"
            problem = f"needs the actual motion, but {why}"
            head, dot, element = asked[0].name.partition(".")
            other = f"{head}_constant_speed{dot}{element}"
            other = other if other in measure_names(scene) else "a measure at constant speed"
            raise DesignError(asked[0].name, problem, f"{remedy}, or use {other}")

    def _kinds(self, limits: int) -> list[Kind]:
        """Bounds and scales, from the values and derivatives at the start."""
        found, span = [], self.upper - self.lower
        self._check_initial(self.first)
        for i, block in enumerate(self.first):
            j = i % len(self.asked)
            limit, case = self.asked[j], self.cases[i // len(self.asked)].name
            role = "objective" if j == 0 else "limit" if j <= limits else "sound"
            bound = block.value if limit.bound == INITIAL else float(limit.bound)
            sign = 1.0 if limit.sense == "at most" else -1.0
            sizes = block.vectors[:, 0] * sign if block.signed else np.linalg.norm(block.vectors, axis=1)
            effect = float(np.max(np.abs(block.slope[int(np.argmax(sizes))] * span)))
            kind = Kind(limit.name, case, limit.term.unit, role, block.signed, sign, 0.0, 1.0, 1.0, effect,
                        limit.term.squares and not block.signed)  # fmt: skip
            own = max(kind.size(_finite(block.value)), effect) or 1.0  # a value that happens to be small is not a scale
            kind = dataclasses.replace(kind, scale=own, own=own)
            found.append(kind if role == "objective" else kind.bounded(bound))
        common = max(kind.scale for kind in found if kind.role == "objective")  # all cases have one scale
        return [dataclasses.replace(kind, scale=common) if kind.role == "objective" else kind for kind in found]


def _finite(values: Any) -> float:
    """The largest magnitude of the finite values."""
    return float(np.max(np.abs(np.nan_to_num(values, posinf=0.0, neginf=0.0)), initial=0.0))


def _check_used(own: Own) -> None:
    """Raise `DesignError` for an own number that no function uses."""
    for name in own:
        if name not in own.read:
            remedy = f'give a function two parameters, (scene, own), and use own["{name}"], or do not free it'
            raise DesignError(f"{OWN}{name}", "is a design variable, but no function uses it", remedy)


def _linked(scene: Scene, variable: Variable, at: Number) -> list[tuple[Number, float]]:
    found, value = [], float(at.read(scene))
    for name in variable.linked:
        if value == 0:
            problem = f"is zero, so the linked {name} has no ratio to it"
            raise DesignError(variable.name, problem, "start from another value")
        other = number(scene, name)
        found.append((other, float(other.read(scene)) / value))
    return found
