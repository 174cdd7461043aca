"""`NativePhysics`: the native engine's handle on its worlds, and the worlds behind it.

Worlds change in place. A handle remembers the generation of the worlds that it stands for: every step, write and load
makes the next generation and returns a new handle, so that older handles are recognised as stale.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from ig2mj.engine.native.contacts import FingerForces
from ig2mj.engine.native.copying import clone, restore
from ig2mj.engine.native.lazy_fields import RAW, Agents, ObjectMotion
from ig2mj.engine.native.one_world import NativeWorld, Statics
from ig2mj.engine.native.view_rows import FIELDS, OF_AGENTS, Changed
from ig2mj.engine.saved import SavedPhysics
from ig2mj.engine.view import AgentView, LazyFields, PhysicsView, but_agents, fields_of
from ig2mj.errors import EngineError, StaleStateError

_VELOCITIES = ("object_linvel", "object_angvel")


class LiveWorlds:
    """The worlds of an engine, changed in place.

    Attributes:
      generation: how many times they were stepped, written to or loaded.
      worlds: one `NativeWorld` each. arrays: [W, ...] working arrays, by field of the view; never handed out.
      view: the view last made; while nothing moves, the same object is handed out again.
    """

    def __init__(self, worlds: list[NativeWorld], arrays: dict[str, np.ndarray], statics: Statics):
        self.worlds, self.arrays, self.statics = worlds, arrays, statics
        self.generation = 0
        self.view: PhysicsView | None = None
        self.of_objects: ObjectMotion  # these three compute fields of the view
        self.of_agents: Agents
        self.of_fingers: FingerForces

    def changed(self) -> NativePhysics:
        """The handle on the worlds after a change; all others are stale from now on."""
        self.generation = generation = self.generation + 1
        return NativePhysics(self, generation)

    def current(self) -> NativePhysics:
        """A handle on the worlds as they are."""
        return NativePhysics(self, self.generation)

    def clone(self) -> LiveWorlds:
        """A copy that shares nothing that changes."""
        arrays = {name: array.copy() for name, array in self.arrays.items()}
        rows = [{name: array[w] for name, array in arrays.items()} for w in range(len(self.worlds))]
        new = LiveWorlds([clone(*pair) for pair in zip(self.worlds, rows, strict=True)], arrays, self.statics)
        if self.view is not None:  # views, and what computes fields of them, are never changed
            new.view, new.of_objects = self.view, self.of_objects
            new.of_agents, new.of_fingers = self.of_agents, self.of_fingers
        return new

    def saved(self) -> SavedPhysics:
        """All worlds in arrays that share no memory with them."""
        rows = [world.save() for world in self.worlds]
        return SavedPhysics(
            snapshot=jax.tree.map(lambda *arrays: np.stack(arrays), *rows),
            view=jax.tree.map(np.array, self.update(Changed.NOTHING)),
            overflow=np.zeros(len(self.worlds), np.int32),
            wrong_controls=np.array([world.wrong_controls for world in self.worlds]),
            lost=np.array([bool(world.lost) for world in self.worlds]),
        )

    def restore(self, saved: SavedPhysics) -> None:
        """Becomes what was saved; the view is the saved one, forces included."""
        for w, world in enumerate(self.worlds):
            world.model_slot.put(world.fields)
            row = jax.tree.map(lambda a, w=w: np.asarray(a[w]), saved.snapshot)
            restore(world, row, saved.view)
            world.wrong_controls = bool(saved.wrong_controls[w])
        self.update(Changed.ALL)

    def update(self, changed: int) -> PhysicsView:
        """The view of the present state: copies of what changed, the old arrays for the rest."""
        if self.view is None:
            self.view, changed = PhysicsView.over({}), Changed.ALL
        if not changed:
            return self.view
        arrays, known = self.arrays, dict(fields_of(self.view))
        for name in _fields_of(changed):
            known[name] = arrays[name].copy()
        if changed & Changed.OBJECTS:
            for name in _VELOCITIES:
                known.pop(name, None)
            self.of_objects = ObjectMotion(self.statics.lazy, arrays["qvel"].copy(), known["object_quat"])
        if changed & OF_AGENTS:
            known["agent"] = self._agents(known, changed)
        scene = object() if changed & ~OF_AGENTS else but_agents(self.view)
        self.view = PhysicsView.over(LazyFields(known, self.of_objects, scene))
        return self.view

    def _agents(self, fields: Mapping[str, Any], changed: int) -> AgentView:
        known = dict(fields_of(fields["agent"])) if "agent" in fields else {}
        if changed & Changed.AGENT:
            contacts, force = [world.agent_contacts for world in self.worlds], known.get("finger_force")
            raw = self.arrays[RAW].copy()
            self.of_agents = Agents(self.statics.lazy, fields["body_pos"], fields["body_quat"], raw, contacts)
            known = {} if force is None else {"finger_force": force}
        if changed & Changed.FINGERS:  # worlds change no list that stands here
            self.of_fingers = FingerForces(self.statics.forces, [world.pressing for world in self.worlds])
            known.pop("finger_force", None)
        agents, fingers = self.of_agents, self.of_fingers
        return AgentView.over(LazyFields(known, lambda name: fingers() if name == "finger_force" else agents(name)))


class _Unpickled:
    """Worlds of a pickle, until an engine takes them up. `generation` is that of no handle."""

    generation = -1

    def __init__(self, saved: SavedPhysics):
        self.saved = saved


class NativePhysics:
    """A handle on the worlds of a native engine as they are in one generation.

    `copy.deepcopy` gives an independent copy, as `NativeEngine.fork` does. A pickle holds all worlds in arrays; the
    engine to which its handle is given first makes worlds of them.
    """

    __slots__ = ("_live", "generation")

    def __init__(self, live: LiveWorlds | _Unpickled, generation: int):
        self._live: Any = live  # looked at in every step
        self.generation = generation

    @property
    def worlds(self) -> list[NativeWorld]:
        """The worlds. Raises StaleStateError: they have changed since this handle was made."""
        return self.live().worlds

    def live(self, make: Callable[[SavedPhysics], LiveWorlds] | None = None) -> LiveWorlds:
        """The worlds of this handle.

        Args:
          make: makes worlds of a pickle.

        Raises:
          StaleStateError: they have changed since this handle was made. EngineError: they are those of a pickle, and
            cannot be made.
        """
        live = self._live
        if isinstance(live, _Unpickled):
            if make is None:
                raise EngineError("physics of a pickle has no worlds yet: step it first")
            live = self._live = make(live.saved)
        if live.generation != self.generation:
            raise StaleStateError
        return live

    def current(self) -> NativePhysics:
        """A handle on the same worlds as they are now, whatever this one stands for."""
        return self._live.current() if isinstance(self._live, LiveWorlds) else self

    def is_stale(self) -> bool:
        """The worlds have changed since this handle was made."""
        return isinstance(self._live, LiveWorlds) and self._live.generation != self.generation

    def fork(self) -> NativePhysics:
        """An independent copy. Raises StaleStateError."""
        if isinstance(self._live, _Unpickled):
            return NativePhysics(self._live, self.generation)
        return self.live().clone().current()

    def __copy__(self) -> NativePhysics:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> NativePhysics:
        return self.fork()

    def __reduce__(self) -> tuple[Any, ...]:
        saved = self._live.saved if isinstance(self._live, _Unpickled) else self.live().saved()
        return _unpickled, (saved,)

    def __repr__(self) -> str:
        if isinstance(self._live, _Unpickled):
            return "NativePhysics(of a pickle)"
        stale = ", stale" if self.is_stale() else ""
        return f"NativePhysics({len(self._live.worlds)} worlds, generation {self.generation}{stale})"


def _unpickled(saved: SavedPhysics) -> NativePhysics:
    return NativePhysics(_Unpickled(saved), 0)


@functools.cache
def _fields_of(changed: int) -> tuple[str, ...]:
    return tuple(name for name, group in FIELDS.items() if group & changed)
