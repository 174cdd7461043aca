"""What a `Simulation` knows of extended states and predicates: ask, set, explain, save and restore, by name.

The states of one world are stepped by a `StateStepper` after every control step of physics. Compiled functions belong
to the scene and are shared by all simulations of it.
"""

from __future__ import annotations

import os
import weakref
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.base import Engine, Physics, Write
from ig2mj.engine.view import PhysicsView
from ig2mj.errors import AbilityError, InputError, StateError
from ig2mj.predicates.compile import CompiledExpression, compile_expression
from ig2mj.predicates.literals import object_index
from ig2mj.predicates.logic import Atom, Expression
from ig2mj.predicates.stepper import StateProgram, StateStepper
from ig2mj.process import run_programs_inline
from ig2mj.sampling.setters import lacks, set_by_name
from ig2mj.scene.scene import Scene
from ig2mj.states import registry
from ig2mj.states.initial import states_of_manifest
from ig2mj.states.model import StateModel
from ig2mj.states.options import StateOptions
from ig2mj.states.world import ExtendedStates, Swap, WorldState
from ig2mj.worlds.archive import load_tree, save_tree

ARCHIVE_VERSION = 1
"""Of the files that `save` writes."""


class SceneStates:
    """Constants and compiled functions of a scene's states under one set of options; made once."""

    _made: ClassVar[weakref.WeakKeyDictionary] = weakref.WeakKeyDictionary()  # Scene -> {options: SceneStates}

    def __init__(self, scene: Scene, options: StateOptions):
        self.model = StateModel.of_manifest(scene.tables, scene.manifest, options)
        self.program = StateProgram(self.model)
        bodies = {scene.model.body(b).name: b for b in range(scene.model.nbody)}
        self.initial = states_of_manifest(self.model, scene.manifest, bodies)
        self._expressions: dict[tuple[Any, bool], CompiledExpression] = {}

    @classmethod
    def of(cls, scene: Scene, options: StateOptions) -> SceneStates:
        """The scene's, made at the first call."""
        made = cls._made.setdefault(scene, {})
        if options not in made:
            made[options] = cls(scene, options)
        return made[options]

    def compiled(self, expression: Expression | str, strict: bool) -> CompiledExpression:
        """The compiled expression; asked again, the same object."""
        key = (expression, strict)
        if key not in self._expressions:
            self._expressions[key] = compile_expression(self.model, expression, strict=strict)
        return self._expressions[key]


class SimulationStates:
    """The part of `Simulation` that deals with extended states.

    Attributes:
      state_options: None where the simulation steps physics only.
    """

    scene: Scene
    engine: Engine
    physics: Physics
    state_options: StateOptions | None

    def _start_states(self, options: StateOptions | None, seed: int) -> None:
        run_programs_inline()
        self.state_options, self._seed = options, seed
        self._scene_states: SceneStates | None = None
        self._stepper: StateStepper | None = None
        self._states: ExtendedStates | None = None
        self._reset_states()

    def _reset_states(self) -> None:
        self._key = jax.random.key(self._seed)
        self._steps = 0
        if self._scene_states is not None:
            self._states, self._stepper = self._scene_states.initial, StateStepper(self._scene_states.program)

    @property
    def _rules(self) -> SceneStates:
        if self.state_options is None:
            raise StateError("this simulation steps physics only; make it with states=StateOptions()")
        if self._scene_states is None:
            self._scene_states = SceneStates.of(self.scene, self.state_options)
            self._reset_states()
        return self._scene_states

    @property
    def _view(self) -> PhysicsView:
        return self.engine.view(self.physics)

    def prepare(self) -> None:
        """Compiles what the first step needs, without taking it."""
        if self.state_options is not None:
            StateStepper(self._rules.program).step(self.states, self._view)

    def _step_states(self, view: PhysicsView) -> PhysicsView:
        """The states after a control step; returns the view, a new one where slicing moved things."""
        if self.state_options is None:
            return view
        states = self.states
        assert self._stepper is not None
        self._states, swap, _ = self._stepper.step(states, view)
        self._steps += 1
        return view if swap is None else self._swap(swap)

    def _swap(self, swap: Swap) -> PhysicsView:
        objects, count = self._rules.model.swap_objects, self.scene.tables.num_objects
        mask, pos, quat = np.zeros((1, count), bool), np.zeros((1, count, 3)), np.zeros((1, count, 4))
        mask[:, objects], pos[:, objects], quat[:, objects] = swap.mask, swap.pos, swap.quat
        self.physics = self.engine.write(self.physics, Write(object_mask=mask, object_pos=pos, object_quat=quat))
        return self._view

    @property
    def state_model(self) -> StateModel:
        """Constants of the states."""
        return self._rules.model

    @property
    def states(self) -> ExtendedStates:
        """Extended states; world axis of length 1."""
        _ = self._rules
        assert self._states is not None
        return self._states

    @property
    def world(self) -> WorldState:
        """Everything of this world, as compiled expressions and environments take it."""
        seconds = self._steps * self.engine.substeps * self.engine.timestep
        return WorldState(
            physics=self.physics,
            view=self._view,
            states=self.states,
            key=np.asarray(jax.random.key_data(self._key))[None],
            step=np.array([self._steps], np.int32),
            time=np.array([seconds], np.float32),
        )

    def state(self, name: str, object_name: str | None = None) -> Any:
        """A state of one object, or of every object that has it: {object: value}.

        Args:
          name: see `ig2mj.states.registry.STATES`.
          object_name: halves of a sliced object are objects of their own.

        Raises:
          UnknownNameError: no such state or object. AbilityError: the object does not have this state.
        """
        kind, model, view = registry.find(name), self._rules.model, self._view
        if object_name is not None:
            index = object_index(model, object_name)
            if not kind.belongs_to(model, index):
                raise AbilityError(lacks(f"state '{kind.name}'", object_name, model, kind.abilities or ()))
            return kind.get(model, self.states, view, index, 0)
        names = self.scene.tables.object_names
        having = [o for o in range(len(names)) if kind.belongs_to(model, o)]
        return {names[o]: kind.get(model, self.states, view, o, 0) for o in having}

    def set_state(self, name: str, object_name: str, value: bool | float | int) -> None:
        """Sets a state, or makes a predicate of one object true or false as the paper samples it (table A.5).

        Args:
          name: temperature, max_temperature or wetness, with a number; or cooked, burnt, frozen,
            soaked, dusty, stained, toggled_on, open, or sliced (only True).
          object_name: its halves, where it has some, are set alike.

        Raises:
          UnknownNameError, AbilityError: as for `state`. StateError: the state cannot be set, or not to this value.
        """
        self._key, key = jax.random.split(self._key)
        change = set_by_name(self._rules.model, self.states, self._view, name, object_name, value, key)
        self._states = change.states
        if change.swap is not None:
            self._swap(change.swap)
        if change.joints is not None:
            self._write_joints(*change.joints)

    def _write_joints(self, positions: np.ndarray, moves: np.ndarray) -> None:
        address, width = self.scene.tables.openable_qposadr, self.scene.model.nq
        mask, qpos = np.zeros((1, width), bool), np.zeros((1, width))
        mask[:, address], qpos[:, address] = moves, positions
        self.physics = self.engine.write(self.physics, Write(qpos_mask=mask, qpos=qpos))

    def predicate(self, name: str, *arguments: str, strict: bool = False) -> bool:
        """Whether a predicate holds now, e.g. `predicate("on_top", "book", "table")`.

        Raises:
          UnknownNameError: no such predicate, object or room. ArityError: too many or too few arguments.
          AbilityError: with `strict`, the object lacks the ability; otherwise that is False.
        """
        return self.holds(Atom(name, arguments), strict=strict)

    def holds(self, expression: Expression | str, strict: bool = False) -> bool:
        """Whether an expression holds now; text as `ig2mj.predicates.parse` reads it. Raises ExpressionError, and as
        `predicate`."""
        return bool(self._rules.compiled(expression, strict)(self.world)[0])

    def compiled(self, expression: Expression | str, strict: bool = False) -> CompiledExpression:
        """An expression compiled for this scene, to be asked again and again: `compiled(goal)(simulation.world)`."""
        return self._rules.compiled(expression, strict)

    def explain(self, expression: Expression | str) -> str:
        """Whether an expression holds now, and what is missing where it does not."""
        return self._rules.compiled(expression, False).explain(self.world)

    def save(self, path: str | os.PathLike) -> None:
        """Writes the whole world, physics and states, to one `.npz` (arrays only, no pickle)."""
        header = {
            "version": ARCHIVE_VERSION,
            "scene": self.scene.name,
            "engine": self.engine.name,
            "objects": list(self.scene.tables.object_names),
        }
        save_tree(path, self._everything(), header)

    def restore(self, path: str | os.PathLike) -> PhysicsView:
        """Goes back to a world that `save` wrote, of this scene. Raises InputError."""
        found, header = load_tree(path, self._everything())
        if header.get("version") != ARCHIVE_VERSION:
            raise InputError(path, f"has version {header.get('version')}, this ig2mj reads {ARCHIVE_VERSION}")
        if header.get("objects") != list(self.scene.tables.object_names):
            raise InputError(path, f"is of scene '{header.get('scene')}'", mend="restore it in that scene")
        self.physics = self.engine.load(self.physics, found["physics"])
        self._states = jax.tree.map(jnp.asarray, found["states"])
        self._key = jax.random.wrap_key_data(jnp.asarray(found["key"]))
        self._steps = int(found["step"][0])
        self._stepper = StateStepper(self._rules.program)
        return self._view

    def _everything(self) -> dict[str, Any]:
        physics = jax.tree.map(lambda leaf: np.asarray(leaf)[None], self.engine.export(self.physics, 0))
        return {
            "physics": physics,
            "states": self.states,
            "key": np.asarray(jax.random.key_data(self._key)),
            "step": np.array([self._steps]),
        }
