"""`Facts`: truth of atoms in one world of a batch; each atom is evaluated once.

Axes: W worlds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import jax
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import PhysicsView
from ig2mj.planning.domain import Domain
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.literals import Literals
from ig2mj.predicates.logic import Atom
from ig2mj.predicates.registry import find
from ig2mj.states.world import ExtendedStates


class Facts:
    """The facts of one world at the time of construction.

    Attributes:
      domain: constants. view, states: of this world, with a world axis of length 1.
      held: names of what the robot holds, in the order of its hands' numbers; hands that hold nothing are left out.
    """

    def __init__(
        self,
        domain: Domain,
        states: ExtendedStates,
        view: PhysicsView,
        world: int = 0,
        held: Sequence[str] = (),
    ):
        """`states`, `view`: of all worlds; `world`: which one."""
        if len(np.asarray(states.sliced)) > 1:
            states, view = jax.tree.map(lambda leaf: np.asarray(leaf)[world : world + 1], (states, view))
        self.domain, self.states, self.view = domain, states, view
        self.held = tuple(held)
        self._known: dict[Atom, bool] = {}
        self._queries = HostQueries.of(domain.model)

    def truth(self, atoms: Iterable[Atom]) -> dict[Atom, bool]:
        """Truth of atoms, evaluated together; of an object without the ability, false."""
        atoms = list(dict.fromkeys(atoms))
        self._known |= {a: False for a in atoms if not self._able(a)}
        if new := [a for a in atoms if a not in self._known]:
            literals = Literals.build(self.domain.model, new)
            facts = self._queries.facts(literals, self.states, self.view)
            values = np.asarray(literals.combine(facts, self.states.sliced))[0]
            self._known |= dict(zip(new, values.tolist(), strict=True))
        return {a: self._known[a] for a in atoms}

    def holds(self, predicate: str, *arguments: str) -> bool:
        """Truth of one predicate."""
        atom = Atom(predicate, arguments)
        return self.truth([atom])[atom]

    def _able(self, atom: Atom) -> bool:
        ability = find(atom.predicate).ability
        return ability is None or self.domain.has(atom.arguments[0], ability)

    def place(self, name: str) -> Float[np.ndarray, "3"]:
        """Centre of mass of an object, m, world frame."""
        return np.asarray(self.view.object_com)[0, self.domain.index(name)]

    def box(self, name: str) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """World box of an object: low and high corner, m."""
        index = self.domain.index(name)
        return np.asarray(self.view.aabb_low)[0, index], np.asarray(self.view.aabb_high)[0, index]

    def open_share(self, name: str) -> float:
        """Share of its range, 0 to 1, to which the joint of an object is open that is open farthest; 0 without one."""
        tables = self.domain.model.tables
        own = tables.openable_object == self.domain.index(name)
        closed, opened = tables.openable_closed[own], tables.openable_open[own]
        return float(((np.asarray(self.view.joint_pos)[0, own] - closed) / (opened - closed)).max(initial=0.0))

    def sliced(self, name: str) -> bool:
        """Whether an object has been cut, so that its halves stand for it."""
        return bool(np.asarray(self.states.sliced)[0, self.domain.index(name)]) and bool(self.domain.halves(name))

    def containers(self, name: str) -> tuple[str, ...]:
        """Objects with doors, drawers or lids that an object is inside of; none for a room."""
        if name in self.domain.model.tables.room_names:
            return ()
        middle = self.place(name)
        near = []
        for other in self.domain.openable:
            low, high = self.box(other)
            if other != name and (low <= middle).all() and (middle <= high).all():
                near.append(Atom("inside", (name, other)))
        truth = self.truth(near)
        return tuple(a.arguments[1] for a in near if truth[a])

    def things_in(self, name: str) -> tuple[str, ...]:
        """Loose objects inside of an object, but for what hands hold."""
        low, high = self.box(name)
        near = []
        for other in self.domain.loose:
            middle = self.place(other)
            if other not in (name, *self.held) and (low <= middle).all() and (middle[:2] <= high[:2]).all():
                near.append(Atom("inside", (other, name)))
        truth = self.truth(near)
        return tuple(a.arguments[0] for a in near if truth[a])

    def borne(self, name: str) -> tuple[Atom, ...]:
        """What says of loose objects that they are in or on an object, or in or on these, but for what hands hold. What
        is on something touches nothing else: what leans against another object does not stay on it when it is taken."""
        found: dict[str, Atom] = {}
        bearers = [name]
        for bearer in bearers:
            (low, high), near = self.box(bearer), list[Atom]()
            for other in self.domain.loose:
                middle = self.place(other)
                above = (low <= middle).all() and (middle[:2] <= high[:2]).all()
                if above and other not in (name, bearer, *found, *self.held):
                    near += [Atom(predicate, (other, bearer)) for predicate in ("inside", "on_top")]
            true = [a for a, holds in reversed(self.truth(near).items()) if holds]
            found |= self._staying({a.arguments[0]: a for a in true}, bearer)
            bearers += [other for other in found if other not in bearers]
        return tuple(found.values())

    def _staying(self, borne: dict[str, Atom], bearer: str) -> dict[str, Atom]:
        """Of what is in or on a bearer, what is in it, and what touches nothing but it and others that stay."""
        touching = np.asarray(self.view.touching)[0]
        touched = {name: set(np.flatnonzero(touching[self.domain.index(name)]).tolist()) for name in borne}
        while True:
            own = {self.domain.index(name) for name in (bearer, *borne)}
            kept = {n: atom for n, atom in borne.items() if atom.predicate == "inside" or touched[n] <= own}
            if len(kept) == len(borne):
                return kept
            borne = kept

    def room(self, name: str) -> str:
        """Room instance above whose floor an object is; the home's floor object where the map has none there."""
        tables = self.domain.model.tables
        if len(tables.room_names):
            x, y = self.place(name)[:2]
            size = tables.room_map.shape[0]
            row, column = (int(v / tables.room_resolution + size / 2) for v in (y, x))
            if 0 <= row < size and 0 <= column < size and (found := int(tables.room_map[row, column])) > 0:
                return tables.room_names[found - 1]
        floors = [n for n, is_floor in zip(tables.object_names, tables.object_is_floor, strict=True) if is_floor]
        return floors[0] if floors else ""
