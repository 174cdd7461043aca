"""The overlay of the interactive viewer that shows extended states: texts, tints, particles."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np

from ig2mj.engine.view import PhysicsView
from ig2mj.scene.scene import Scene
from ig2mj.sensors.tints import TINTS, UNTINTED
from ig2mj.states.definitions.temperature import AMBIENT_TEMPERATURE
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.viewer.overlays import Label
from ig2mj.viewer.state_effects import effects
from ig2mj.viewer.state_marks import Mark, Tinter, marks, tint_of_objects

CHANGED_BY = 0.5
"""Degrees from room temperature at which a temperature is worth a text."""


@runtime_checkable
class StatefulWorld(Protocol):
    """What the overlay asks of a world; `ig2mj.Simulation` is one."""

    @property
    def scene(self) -> Scene: ...

    @property
    def states(self) -> ExtendedStates: ...

    @property
    def state_model(self) -> StateModel: ...

    @property
    def view(self) -> PhysicsView: ...


class StatesOverlay:
    """Temperature, wetness, dirt and switches next to every object whose states differ from the start."""

    title = "states"

    def __init__(self, world: StatefulWorld, model: mujoco.MjModel):
        """`model` is the one that is drawn."""
        self._world, self._tinter = world, Tinter(model, world.scene.tables.geom_object)

    def labels(self, data: mujoco.MjData) -> list[Label]:
        """One text per object that has something to tell."""
        view, found = self._world.view, []
        for index, words in describe(self._world.state_model, self._world.states).items():
            x, y, z = (float(v) for v in np.asarray(view.object_com)[0, index])
            found.append(Label((x, y, z), words, (0.6, 1.0, 0.6, 1.0)))
        return found

    def lines(self, data: mujoco.MjData) -> list[tuple[str, str]]:
        return []

    def marks(self, data: mujoco.MjData) -> list[Mark]:
        """Particles and drops; also tints the objects."""
        self._tinter.apply(tint_of_objects(self._world.state_model, self._world.states))
        world = self._world.state_model, self._world.states, self._world.view
        return [*marks(*world), *effects(*world, time=float(data.time))]

    def hide(self) -> None:
        """Gives the objects their own colours back."""
        self._tinter.restore()


def describe(model: StateModel, states: ExtendedStates, world: int = 0) -> dict[int, str]:
    """What is written about each object, by index: only what differs from a warm, dry, clean, switched-off start."""
    p, found = model.parameters, {}
    tint = tint_of_objects(model, states, world)
    host: dict[str, Any] = {n: np.asarray(getattr(states, n))[world] for n in ("temperature", "wetness", "sliced")}
    dirt = {}
    for name, rows, of in (("dust", states.dust, p.dust_rows), ("stain", states.stain, p.stain_rows)):
        alive = np.asarray(rows.alive)[world].sum(axis=-1)
        dirt[name] = dict(zip(of.tolist(), alive.tolist(), strict=True))
    for o in range(model.tables.num_objects):
        words = []
        if p.thermal[o] and abs(host["temperature"][o] - AMBIENT_TEMPERATURE) > CHANGED_BY:
            words.append(f"{host['temperature'][o]:.0f} C")
        if tint[o] != UNTINTED:
            words.append(TINTS[tint[o]].predicate.name.replace("_", " "))
        if host["wetness"][o] > 0:
            words.append(f"wet {host['wetness'][o]:g}")
        words += [f"{name} {count[o]}" for name, count in dirt.items() if count.get(o)]
        if words:
            found[o] = ", ".join(words)
    return found
