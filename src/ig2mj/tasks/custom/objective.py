"""`CustomObjective`: the objective of a task with some of it in functions of the user's.

What the functions leave out comes from the base objective. All are called when the environment is made, on arrays
without values, so that a wrong shape or a name that does not exist is an error then.

Axes: W worlds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView, axis_sizes, blank_view
from ig2mj.errors import InputError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.states.initial import initial_states
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.custom.code import Function, TaskCode, call, label_of, place_of
from ig2mj.tasks.custom.view import TaskView
from ig2mj.tasks.objective import Measures, Objective
from ig2mj.worlds.rules import Rules

TRIED = 11
"""Worlds of the trial call: a number that an axis of something else hardly has by chance."""

PRIVILEGED = "privileged_state"


@struct.dataclass
class CustomMeasures:
    """What an objective with functions must know of a step.

    Attributes:
      base: measures of the base objective. own: what `measure` gave. terms: of the step's reward; zeros at the start of
        an episode, none where the base objective gives them. success, over: how the episode ends.
    """

    base: Measures
    own: dict[str, Array]
    terms: dict[str, Float[Array, "W"]]
    success: Bool[Array, "W"]
    over: Bool[Array, "W"]


class CustomObjective:
    """See `ig2mj.tasks.objective.Objective`. Attributes: code: the functions. base: what they leave out."""

    def __init__(
        self, base: Objective, code: TaskCode, scene: Scene, rules: Rules, hands: tuple[int, ...], action_size: int
    ):
        """Calls every function once, on arrays without values.

        Args:
          rules: of the scene, with the task's goal. hands: numbers of the acting hands among the scene's.
          action_size: numbers of an action.

        Raises:
          InputError: a function raised, or gives something of another shape or type than it must.
        """
        self.base, self.code = base, code
        self._scene, self._rules, self._hands, self._action_size = scene, rules, hands, action_size
        self.outcomes = base.outcomes
        self.terms: tuple[str, ...] = base.terms
        self.vectors: dict[str, tuple[str, ...]] = dict(base.vectors)
        self._try()

    # What is measured.

    def measure(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        status: GoalStatus,
        row: Int[Array, "W"] | None,
        before: CustomMeasures | None = None,
        action: Float[Array, "W n"] | None = None,
    ) -> CustomMeasures:
        base = self.base.measure(view, states, status, row, None if before is None else before.base)
        seen = self._view(view, states, status, before, action)
        own = {} if self.code.measure is None else _measures(self.code.measure, seen)
        now = _with(seen, now=own)
        if before is None:
            zeros = {name: now.zeros() for name in self.terms} if self.code.reward is not None else {}
            none = jnp.zeros(now.num_worlds, bool)
            return CustomMeasures(base, own, zeros, none, none)
        terms = {} if self.code.reward is None else _terms(self.code.reward, now)
        success, over = self._ends(now, base, status)
        return CustomMeasures(base, own, terms, success, over)

    def _ends(self, seen: TaskView, base: Measures, status: GoalStatus) -> tuple[Bool[Array, "W"], Bool[Array, "W"]]:
        success, over = self.base.ended(base, status)
        if self.code.success is not None:
            success = _truth(self.code.success, seen)
        if self.code.success is not None or self.code.failure is not None:
            over = jnp.asarray(success)
        if self.code.failure is not None:
            over = over | (_truth(self.code.failure, seen) & ~jnp.asarray(success))
        if self.code.terminated is not None:
            over = _truth(self.code.terminated, seen)
        return jnp.asarray(success), jnp.asarray(over)

    def _view(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        status: GoalStatus,
        before: CustomMeasures | None,
        action: Array | None,
    ) -> TaskView:
        worlds = view.object_com.shape[0]
        given = jnp.zeros((worlds, self._action_size), jnp.float32) if action is None else jnp.asarray(action)
        return TaskView(
            view=view,
            states=states,
            scene=self._scene,
            model=self._rules.model,
            hands=self._hands,
            goal=status,
            action=jnp.clip(jnp.where(jnp.isfinite(given), given, 0.0), -1.0, 1.0).astype(jnp.float32),
            before=None if before is None else before.own,
            compiled=self._rules.compiled,
        )

    # What follows from it.

    def rewards(self, before: CustomMeasures, now: CustomMeasures) -> dict[str, Float[Array, "W"]]:
        return self.base.rewards(before.base, now.base) if self.code.reward is None else now.terms

    def ended(self, now: CustomMeasures, status: GoalStatus) -> tuple[Bool[Array, "W"], Bool[Array, "W"]]:
        return now.success, now.over

    def info(self, view: PhysicsView, now: CustomMeasures, status: GoalStatus) -> dict[str, Array]:
        """As of the base objective; "goal_progress" of a task that has a function for its success is whether it is
        reached."""
        found = self.base.info(view, now.base, status)
        if self.code.success is not None:
            found |= {"goal_progress": jnp.asarray(now.success).astype(jnp.float32)}
        return found

    def observe(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        now: CustomMeasures,
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Float[Array, "W n"]]:
        made = self.base.observe(view, states, now.base, status, time_left)
        seen = _with(self._view(view, states, status, None, None), now=now.own, time_left=time_left)
        if self.code.observe is not None:
            made[PRIVILEGED] = _columns(_observed(self.code.observe, seen))
        for name, function in self.code.observations.items():
            made[name] = _columns(_observed(function, seen))
        return made

    def refuse_nonfinite(self, info: Mapping[str, Array]) -> None:
        """Raises InputError where a term of the reward is not finite; on the host."""
        for name in self.terms:
            worlds = np.flatnonzero(~np.isfinite(np.asarray(info[f"reward/{name}"])))
            if len(worlds):
                function = self.code.reward
                where = ("the task", self.code.name) if function is None else (place_of(function), label_of(function))
                value = float(np.asarray(info[f"reward/{name}"])[worlds[0]])
                term = "" if len(self.terms) == 1 else f"the term '{name}' "
                problem = f"{term}is {value} in world {worlds[0]}, and must be finite"
                raise InputError(where[0], problem, element=where[1])

    def check_pure(self, view: PhysicsView, states: ExtendedStates, status: GoalStatus) -> None:
        """What shapes do not show, on values; on the host, for tests.

        Raises:
          AssertionError: a function gives something else when it is called again, or a world's value depends on other
            worlds.
        """

        def all_of(view: PhysicsView, states: ExtendedStates, status: GoalStatus) -> dict[str, Any]:
            worlds = view.object_com.shape[0]
            first = self.measure(view, states, status, jnp.zeros(worlds, jnp.int32))
            now = self.measure(view, states, status, None, first)
            left = jnp.ones(worlds, jnp.float32)
            seen = self.observe(view, states, now, status, left)
            return {
                "measure": now.own,
                "reward": self.rewards(first, now),
                "success": now.success,
                "ends": now.over,
                **{name: seen[name] for name in self._own_vectors()},
            }

        once, again = all_of(view, states, status), all_of(view, states, status)
        order = np.roll(np.arange(view.object_com.shape[0]), 1)
        moved = jax.tree.map(lambda a: np.asarray(a)[order], (view, states, status))
        other = all_of(*moved)
        for name, value in once.items():
            for (path, a), b, c in zip(
                jax.tree_util.tree_leaves_with_path(value),
                jax.tree.leaves(again[name]),
                jax.tree.leaves(other[name]),
                strict=True,
            ):
                what = f"{self.code.name}: {name}{jax.tree_util.keystr(path)}"
                a, b, c = (np.asarray(x) for x in (a, b, c))
                repeats = np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
                assert repeats, f"{what} is not pure: it differs when called again"
                same = np.allclose(a[order], c, rtol=1e-4, atol=1e-5, equal_nan=True)
                assert same, f"{what} of a world depends on other worlds, or on its number"

    def _own_vectors(self) -> list[str]:
        return [*([PRIVILEGED] if self.code.observe is not None else []), *self.code.observations]

    # The trial call.

    def _try(self) -> None:
        view = blank_view(axis_sizes(self._scene.tables, TRIED))
        states = initial_states(self._rules.model, TRIED)
        row = np.zeros(TRIED, np.int32)
        names: dict[str, tuple[str, ...]] = {}
        terms: list[str] = []

        def trial(view: PhysicsView, states: ExtendedStates) -> Any:
            goal = self._rules.goal
            status = GoalStatus.empty(TRIED) if goal is None else goal.status(states, view)
            seen = self._view(view, states, status, None, None)
            base = self.base.measure(view, states, status, row)
            first = {} if self.code.measure is None else _measures(self.code.measure, seen)
            later = _with(seen, before=first)
            own = {} if self.code.measure is None else _measures(self.code.measure, later)
            _same_measures(self.code.measure, first, own)
            now = _with(later, now=own)
            if self.code.reward is not None:
                terms.extend(_terms(self.code.reward, now))
            self._ends(now, base, status)
            watched = _with(seen, now=own, time_left=jnp.ones(TRIED, jnp.float32))
            if self.code.observe is not None:
                names[PRIVILEGED] = _names_of(self.code.observe, _observed(self.code.observe, watched))
            for name, function in self.code.observations.items():
                names[name] = _names_of(function, _observed(function, watched))
            return own

        jax.eval_shape(trial, view, states)
        self.vectors |= names
        if self.code.reward is not None:
            self.terms = tuple(terms)


def _with(seen: TaskView, **fields: Any) -> TaskView:
    return dataclasses.replace(seen, **fields)


# What functions give, checked.


def _wrong(function: Function, problem: str) -> InputError:
    return InputError(place_of(function), problem, element=label_of(function))


def _array(function: Function, value: Any, what: str, expected: str) -> Array:
    """`value` as an array of real numbers or booleans. Raises InputError."""
    if value is None:
        raise _wrong(function, f"{what} is None (does it return?): {expected} is expected")
    try:
        array = jnp.asarray(value)
    except (TypeError, ValueError):
        kind = type(value).__name__
        raise _wrong(function, f"{what} is of type {kind}: {expected} is expected") from None
    real = jnp.issubdtype(array.dtype, jnp.floating) or jnp.issubdtype(array.dtype, jnp.integer)
    if not real and array.dtype != bool:
        raise _wrong(function, f"{what} is of {array.dtype}: {expected} is expected")
    return array


def _per_world(function: Function, value: Any, worlds: int, what: str, expected: str) -> Array:
    array = _array(function, value, what, expected)
    if array.shape != (worlds,):
        raise _wrong(function, f"{what} has shape {_shape(array, worlds)}: {expected} is expected")
    return array


def _shape(array: Array, worlds: int) -> str:
    """A shape with W in place of the number of worlds."""
    return "[" + ", ".join("W" if size == worlds else str(size) for size in array.shape) + "]"


def _terms(function: Function, seen: TaskView) -> dict[str, Float[Array, "W"]]:
    """The terms of a reward; one that is a single array is named "reward"."""
    value, worlds = call(function, seen), seen.num_worlds
    expected = "one number for each world, [W], or such arrays by name"
    if not isinstance(value, Mapping):
        return {"reward": _per_world(function, value, worlds, "the reward", expected).astype(jnp.float32)}
    if not value or not all(isinstance(name, str) and name for name in value):
        raise _wrong(function, f"the reward's terms have names {list(value)}: {expected} is expected")
    if "total" in value:
        raise _wrong(function, "a term is named 'total', which recordings use for the sum: choose another name")
    return {
        name: _per_world(function, term, worlds, f"the term '{name}'", expected).astype(jnp.float32)
        for name, term in value.items()
    }


def _truth(function: Function, seen: TaskView) -> Bool[Array, "W"]:
    expected = "one boolean for each world, [W],"
    array = _per_world(function, call(function, seen), seen.num_worlds, "the result", expected)
    if array.dtype != bool:
        raise _wrong(function, f"the result is of {array.dtype}: {expected} is expected")
    return array


def _measures(function: Function, seen: TaskView) -> dict[str, Array]:
    value, expected = call(function, seen), "a dict of arrays that begin with the world axis, [W, ...],"
    if not isinstance(value, Mapping):
        raise _wrong(function, f"the result is of type {type(value).__name__}: {expected} is expected")
    return {str(name): _begins(function, array, seen, f"'{name}'", expected) for name, array in value.items()}


def _begins(function: Function, value: Any, seen: TaskView, what: str, expected: str) -> Array:
    array = _array(function, value, what, expected)
    if not array.shape or array.shape[0] != seen.num_worlds:
        raise _wrong(function, f"{what} has shape {_shape(array, seen.num_worlds)}: {expected} is expected")
    return array


def _same_measures(function: Function | None, first: Mapping[str, Array], later: Mapping[str, Array]) -> None:
    """Raises InputError where `measure` gives other things at the start of an episode than after a step."""
    for name in [*first, *(n for n in later if n not in first)]:
        pair = [None if name not in made else (made[name].shape, made[name].dtype) for made in (first, later)]
        if pair[0] != pair[1]:
            problem = f"'{name}' differs in shape or type between the start of an episode, where `before` is None, and"
            assert function is not None
            raise _wrong(function, f"{problem} later steps")


def _observed(function: Function, seen: TaskView) -> Mapping[str, Array]:
    """What an observation consists of, [W, ...] by name; by the name "" where it is a single array."""
    value, expected = call(function, seen), "numbers of each world, [W, n], or arrays [W, ...] by name"
    if isinstance(value, Mapping):
        parts = {str(n): _begins(function, array, seen, f"'{n}'", expected) for n, array in value.items()}
        if parts:
            return parts
        raise _wrong(function, f"the observation is empty: {expected} is expected")
    array = _begins(function, value, seen, "the observation", expected)
    if array.ndim != 2:
        raise _wrong(function, f"the observation has shape {_shape(array, seen.num_worlds)}: {expected} is expected")
    return {"": array}


def _columns(parts: Mapping[str, Array]) -> Float[Array, "W n"]:
    flat = [jnp.asarray(a, jnp.float32).reshape(a.shape[0], -1) for a in parts.values()]
    return jnp.concatenate(flat, axis=1)


def _names_of(function: Callable[..., Any], parts: Mapping[str, Array]) -> tuple[str, ...]:
    """What each number of an observation is called."""
    names = list[str]()
    for name, array in parts.items():
        stem = name or function.__name__
        count = int(np.prod(array.shape[1:]))
        axes = "xyz" if name and count == 3 else range(count)
        names += [stem] if array.ndim == 1 else [f"{stem}_{a}" for a in axes]
    return tuple(names)
