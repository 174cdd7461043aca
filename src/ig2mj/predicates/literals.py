"""Literals: predicates of named objects, resolved against a scene and evaluated together.

Names become indices here, once, with typed errors. An object without the ability a predicate asks for answers False,
with one warning, or is an error with `strict`. The halves of a sliced object stand in for it: a predicate of it
holds if it holds for all halves; with it as the second argument, if it holds for any (iGibson raises an error).

Axes: W worlds, L literals.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.errors import AbilityError, Ig2mjError, UnknownNameError
from ig2mj.predicates.base import ANY_ROOM, Context, Predicate
from ig2mj.predicates.logic import Atom
from ig2mj.predicates.registry import find
from ig2mj.predicates.substances import substance_index
from ig2mj.process.user_warning import warn_user
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query

Instance = tuple[str, tuple[int, ...]]
"""A predicate's name and the indices of its arguments."""


class AbilityWarning(UserWarning):
    """A predicate was asked of an object whose category lacks the ability; it is False."""


class ArityError(Ig2mjError):
    """A predicate was given the wrong number of arguments."""


_WARNED: set[tuple[str, str]] = set()


@dataclasses.dataclass(frozen=True)
class Literal:
    """A resolved atom: `able` is false where the ability is missing; then it is False everywhere."""

    atom: Atom
    predicate: Predicate
    arguments: tuple[int, ...]
    able: bool


@dataclasses.dataclass(frozen=True, eq=False)
class Literals:
    """Literals of a scene, which are evaluated together.

    Evaluating has two parts: `facts`, the truth of every instance (a predicate of object indices, each once), and
    `combine`, which makes literals of them.

    Attributes:
      model: constants. literals: the L axis. instances: rows of argument indices per predicate; the I axis is these one
      after the other, and one more that is false.
    """

    model: StateModel
    literals: tuple[Literal, ...]
    instances: dict[str, tuple[tuple[int, ...], ...]]

    @classmethod
    def build(cls, model: StateModel, atoms: Sequence[Atom], strict: bool = False) -> Literals:
        """Resolves names.

        Raises:
          UnknownNameError: no such predicate, object or room. ArityError: too many or too few arguments.
          AbilityError: with `strict`, an object lacks the ability.
        """
        literals = tuple(resolve(model, a, strict) for a in atoms)
        instances: dict[str, dict[tuple[int, ...], None]] = {}
        for literal in literals:
            if literal.able:
                for arguments in _variants(model, literal):
                    instances.setdefault(literal.predicate.name, {})[arguments] = None
        return cls(model, literals, {name: tuple(rows) for name, rows in instances.items()})

    @functools.cached_property
    def place(self) -> dict[Instance, int]:
        """Position of every instance on the I axis."""
        every = [(name, row) for name, rows in self.instances.items() for row in rows]
        return {instance: i for i, instance in enumerate(every)}

    def queries(self) -> list[Query]:
        """The relations that evaluating needs."""
        return [q for name, rows in self.instances.items() for q in find(name).queries(self.model, np.array(rows, int))]

    def evaluate(self, context: Context) -> Bool[Array, "W L"]:
        """Truth of every literal in every world."""
        return self.combine(self.facts(context), context.states.sliced)

    def facts(self, context: Context) -> Bool[Array, "W I"]:
        """Truth of every instance."""
        facts: Bool[Array, "W I"] = jnp.zeros((context.num_worlds, len(self.place) + 1), bool)
        for name, rows in self.instances.items():
            facts = self._laid(facts, name, find(name).evaluate(context, np.array(rows, int)))
        return facts

    def _laid(self, facts: Bool[Array, "W I"], name: str, answer: Bool[Array, "W P"]) -> Bool[Array, "W I"]:
        """Puts a predicate's answers in their places by selection: XLA fuses that, but not a concatenation."""
        axis, count = np.arange(len(self.place) + 1), answer.shape[1]
        start = self.place[(name, self.instances[name][0])]
        mine = (axis >= start) & (axis < start + count)
        return jnp.where(mine, answer[:, np.clip(axis - start, 0, count - 1)], facts)

    def combine(self, facts: Bool[Array, "W I"], sliced: Bool[Array, "W O"]) -> Bool[Array, "W L"]:
        """Literals from facts: halves stand for sliced wholes."""
        last = len(self.place)
        whole = np.array([self.place[(x.predicate.name, x.arguments)] if x.able else last for x in self.literals], int)
        xp, axis = facts.__array_namespace__(), np.arange(len(self.literals))
        sliced = np.asarray(sliced) if isinstance(facts, np.ndarray) else sliced
        found = facts[:, whole]
        for i, literal in enumerate(self.literals):
            if literal.able and len(_variants(self.model, literal)) > 1:
                found = xp.where(axis == i, self._of_halves(literal, facts, sliced)[:, None], found)
        return found

    def _of_halves(self, literal: Literal, facts: Bool[Array, "W I"], sliced: Bool[Array, "W O"]) -> Bool[Array, "W"]:
        parameters, xp = self.model.parameters, facts.__array_namespace__()
        roles = literal.predicate.arguments
        first = literal.arguments[0]

        def about(subject: int) -> Array:
            """The literal with `subject` as first argument; its second argument may have halves."""
            rest = literal.arguments[1:]
            value = facts[:, self.place[(literal.predicate.name, (subject, *rest))]]
            if rest and roles[1] not in NO_OBJECT and (halves := parameters.halves_of(rest[0])):
                of_half = [facts[:, self.place[(literal.predicate.name, (subject, h))]] for h in halves]
                value = xp.where(sliced[:, rest[0]], xp.any(xp.stack(of_half), axis=0), value)
            return value

        halves = parameters.halves_of(first)
        if not halves:
            return about(first)
        return xp.where(sliced[:, first], xp.all(xp.stack([about(h) for h in halves]), axis=0), about(first))


def resolve(model: StateModel, atom: Atom, strict: bool = False) -> Literal:
    """Names to indices; see `Literals.build` for errors."""
    predicate = find(atom.predicate)
    if len(atom.arguments) != predicate.arity:
        raise ArityError(
            f"predicate '{predicate.name}' takes {predicate.arity} argument{'s' * (predicate.arity > 1)}, "
            f"not {len(atom.arguments)}"
        )
    roles = zip(predicate.arguments, atom.arguments, strict=True)
    arguments = tuple(INDEX[role](model, name) for role, name in roles)
    objects = model.tables.num_objects
    if len(arguments) == 2 and predicate.arguments[1] == "object or agent" and min(arguments) >= objects:
        raise Ig2mjError(
            f"predicate '{predicate.name}' of two agents: contacts of agents with each other are not known"
        )
    name, lacks = atom.arguments[0], predicate.lacks(model, arguments[0])
    if lacks:
        message = f"predicate '{predicate.name}' of '{name}': {lacks}"
        if strict:
            raise AbilityError(message)
        if (predicate.name, name) not in _WARNED:
            _WARNED.add((predicate.name, name))
            warn_user(f"{message}; it is False", AbilityWarning)
    return Literal(atom, predicate, arguments, not lacks)


def object_index(model: StateModel, name: str) -> int:
    """Position of an object on the O axis. Raises UnknownNameError."""
    names = model.tables.object_names
    if name not in names:
        raise UnknownNameError("object", name, names)
    return names.index(name)


def room_index(model: StateModel, name: str) -> int:
    """Position of a room instance, or `ANY_ROOM` for the name of a floor object. Raises UnknownNameError."""
    tables = model.tables
    if name in tables.room_names:
        return tables.room_names.index(name)
    floors = [n for n, is_floor in zip(tables.object_names, tables.object_is_floor, strict=True) if is_floor]
    if name in floors:
        return ANY_ROOM
    raise UnknownNameError("room", name, [*tables.room_names, *floors])


def object_or_agent_index(model: StateModel, name: str) -> int:
    """Position of an object, or the number of objects and an agent's position. Raises UnknownNameError."""
    objects, agents = model.tables.object_names, model.tables.agent_names
    if name in agents and name not in objects:
        return len(objects) + agents.index(name)
    if name not in objects:
        raise UnknownNameError("object or agent", name, [*objects, *agents])
    return objects.index(name)


INDEX = {
    "object": object_index,
    "room": room_index,
    "object or agent": object_or_agent_index,
    "substance": substance_index,
}

NO_OBJECT = ("room", "substance")
"""Roles of arguments that no object, and so no half, can have."""


def names_of_objects(atoms: Iterable[Atom], rooms: bool = False) -> list[str]:
    """Names that stand where predicates take objects, in their order, each once; without variables of quantifiers.

    Args:
      rooms: also those that stand where predicates take rooms.

    Raises:
      UnknownNameError: there is no such predicate.
    """
    found = [
        name
        for atom in atoms
        for name, role in zip(atom.arguments, find(atom.predicate).arguments, strict=False)
        if (role not in NO_OBJECT or (rooms and role == "room")) and not name.startswith("?")
    ]
    return list(dict.fromkeys(found))


def _variants(model: StateModel, literal: Literal) -> list[tuple[int, ...]]:
    """The literal's arguments, then those with halves in the place of wholes."""
    choices = []
    for role, index in zip(literal.predicate.arguments, literal.arguments, strict=True):
        halves = model.parameters.halves_of(index) if role not in NO_OBJECT else ()
        choices.append((index, *halves))
    if len(choices) == 1:
        return [(a,) for a in choices[0]]
    return [(a, b) for a in choices[0] for b in choices[1]]
