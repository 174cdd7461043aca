"""`Predicate`: one logical predicate, and `Context`: all that it may read.

A predicate is evaluated for a list of argument tuples in all worlds at once. Arguments are indices: objects, or rooms
where the predicate says so. It computes no more pairs than it is given.

Axes: W worlds, P argument tuples, K arguments of a predicate (1 or 2).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import AnyArray
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query
from ig2mj.states.relations.relations import Relations
from ig2mj.states.relations.touching import finite
from ig2mj.states.spec import Values
from ig2mj.states.world import ExtendedStates

Arguments = Int[AnyArray, "P K"]
"""Indices known before tracing, or traced ones: a predicate treats both alike."""

ANY_ROOM = -1
"""The room argument of `on_floor` where the floor itself is named, not a room."""


@dataclasses.dataclass(frozen=True)
class Context:
    """What predicates read: constants, extended states, physics, and the relations of this step."""

    model: StateModel
    states: ExtendedStates
    view: PhysicsView
    relations: Relations

    @property
    def num_worlds(self) -> int:
        return self.view.object_com.shape[0]

    def known(self, objects: Int[AnyArray, "P"]) -> Bool[Array, "W P"]:
        """Whether the positions of objects are finite; a NaN pose never makes a predicate true."""
        return finite(self.view)[:, objects]

    def none(self, arguments: Arguments) -> Bool[Array, "W P"]:
        """False everywhere."""
        return jnp.zeros((self.num_worlds, len(arguments)), bool)


Role = Literal["object", "room", "object or agent", "substance"]
"""What an argument is. Substances count as `substance_names` of `ig2mj.predicates.substances` does."""

Evaluate = Callable[[Context, Arguments], Bool[Array, "W P"]]
OfStates = Callable[[StateModel, ExtendedStates], Bool[Array, "W O"]]
SetTruth = Callable[[StateModel, ExtendedStates, Bool[Array, "#W O"], bool], Values]
Queries = Callable[[StateModel, Arguments], list[Query]]
Why = Callable[[Context, tuple[int, ...], int], str]


def no_queries(model: StateModel, arguments: Arguments) -> list[Query]:
    """For predicates that need no relations."""
    return []


@dataclasses.dataclass(frozen=True)
class Predicate:
    """One logical predicate.

    `HostQueries.reads` finds what it depends on by tracing it.

    Attributes:
      name: snake_case. arguments: what each argument is; an agent's index is the number of objects plus its own.
        evaluate: truth for argument tuples. ability: without it the first argument's answer is False. never: why the
        answer is False for this object as the first argument, whatever its ability; "": it need not be.
        aliases: other names (iGibson's, BDDL's tokens, the paper's). queries: relations it needs. why: text with
        the numbers behind the answer in one world. per_object: see `of_states`. of_arguments: of what a view says of
        objects it reads only its arguments (their links, bodies and joints), and floors (`goal_rows`).
      set: new fields of the states in which it is true, or false, of the masked objects; of plug-ins' predicates of one
        object.
    """

    name: str
    arguments: tuple[Role, ...]
    evaluate: Evaluate
    ability: str | None = None
    never: Callable[[StateModel, int], str] | None = None
    aliases: tuple[str, ...] = ()
    queries: Queries = no_queries
    why: Why | None = None
    per_object: OfStates | None = None
    set: SetTruth | None = None
    of_arguments: bool = False

    @classmethod
    def of_states(cls, of_states: OfStates, **fields: Any) -> Predicate:
        """A predicate of one object that reads extended states only; `of_states` answers for all objects."""

        def evaluate(context: Context, arguments: Arguments) -> Bool[Array, "W P"]:
            return of_states(context.model, context.states)[:, arguments[:, 0]]

        return cls(arguments=("object",), evaluate=evaluate, per_object=of_states, **fields)

    @property
    def arity(self) -> int:
        return len(self.arguments)

    def lacks(self, model: StateModel, first: int) -> str:
        """Why it is False for this first argument in every state; "": it need not be."""
        if self.ability is not None and self.ability not in model.parameters.abilities[first]:
            return f"its category '{model.tables.object_categories[first]}' is not {self.ability}"
        return "" if self.never is None else self.never(model, first)


def celsius(value: float) -> str:
    """For `why` texts; a highest temperature is minus infinity until the first step."""
    return f"{value:.1f} C" if value > -np.inf else "not known yet"


def yes(value: object) -> str:
    """For `why` texts."""
    return "yes" if bool(value) else "no"
