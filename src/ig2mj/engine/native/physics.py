"""`NativePhysics`: the native engine's handle on its worlds, and the worlds behind it.

Worlds change in place. A handle remembers the generation of the worlds that it stands for: every step, write and load
makes the next generation and returns a new handle, so that older handles are recognised as stale.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ig2mj.engine.native.contacts import FingerForces
from ig2mj.engine.native.copying import clone, restore
from ig2mj.engine.native.later import RAW, Agents, ObjectMotion
from ig2mj.engine.native.one_world import Statics, World
from ig2mj.engine.native.view_rows import FIELDS, OF_AGENTS, Changed
from ig2mj.engine.saved import SavedPhysics
from ig2mj.engine.view import AgentView, PhysicsView
from ig2mj.errors import EngineError, StaleStateError

_VELOCITIES = ("object_linvel", "object_angvel")


class LiveWorlds:
    """The worlds of an engine, changed in place.

    Attributes:
      generation: how many times they were stepped, written to or loaded.
      worlds: one `World` each. arrays: [W, ...] working arrays, by field of the view; never handed out.
      view: the view last made; while nothing moves, the same object is handed out again.
    """

    def __init__(self, worlds: list[World], arrays: dict[str, np.ndarray], statics: Statics):
        self.worlds, self.arrays, self.statics = worlds, arrays, statics
        self.generation = 0
        self.view: PhysicsView | None = None
        self.of_agents: Agents  # what makes the fields of the view's agents
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
        if self.view is not None:  # nobody changes views, nor what makes fields of them later
            new.view, new.of_agents, new.of_fingers = self.view, self.of_agents, self.of_fingers
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
            self.view, changed = PhysicsView.__new__(PhysicsView), Changed.ALL
            self.view.__dict__["agent"] = AgentView.__new__(AgentView)
        elif changed:
            self.view = _copied(self.view)
        if changed:
            arrays, fields = self.arrays, self.view.__dict__
            for name in _fields_of(changed):
                fields[name] = arrays[name].copy()
            if changed & Changed.OBJECTS:
                motion = ObjectMotion(self.statics.later, arrays["qvel"].copy(), fields["object_quat"])
                _make_later(self.view, _VELOCITIES, motion)
            if changed & ~OF_AGENTS:
                fields["_but_agents"] = object()
            if changed & OF_AGENTS:
                fields["agent"] = self._agents(self.view.agent, fields, changed)
        return self.view

    def _agents(self, before: AgentView, fields: dict[str, Any], changed: int) -> AgentView:
        known, statics = before.__dict__, self.statics
        agent = object.__new__(AgentView)
        kept = agent.__dict__
        if changed & Changed.AGENT:
            contacts = [world.agent_contacts for world in self.worlds]
            raw = self.arrays[RAW].copy()
            self.of_agents = Agents(statics.later, fields["body_pos"], fields["body_quat"], raw, contacts)
            if "finger_force" in known:
                kept["finger_force"] = known["finger_force"]
        else:
            kept.update(known)
        if changed & Changed.FINGERS:  # worlds change no list that stands here
            self.of_fingers = FingerForces(statics.forces, [world.pressing for world in self.worlds])
            kept.pop("finger_force", None)
        kept["_later"] = self._of_both()
        return agent

    def _of_both(self) -> Callable[[str], np.ndarray]:
        agents, fingers = self.of_agents, self.of_fingers
        return lambda name: fingers() if name == "finger_force" else agents(name)


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
    def worlds(self) -> list[World]:
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


def _copied(view: PhysicsView) -> PhysicsView:
    """A view of the same arrays; the constructor of a frozen dataclass costs more than to copy what changed."""
    new = object.__new__(PhysicsView)
    new.__dict__.update(view.__dict__)
    return new


def _make_later(view: PhysicsView, names: tuple[str, ...], later: Callable[[str], np.ndarray]) -> None:
    fields = view.__dict__
    for name in names:
        fields.pop(name, None)
    fields["_later"] = later


@functools.cache
def _fields_of(changed: int) -> tuple[str, ...]:
    return tuple(name for name, group in FIELDS.items() if group & changed)
