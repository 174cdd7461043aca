"""`Simulation`: one world: step it, move objects by name, evaluate predicates, render it.

    simulation = ig2mj.Simulation("small_home")
    simulation.set_state("toggled_on", "stove_0", True)
    simulation.step(count=300)                       # ten seconds
    simulation.predicate("cooked", "fish_0")

A core with a single world steps it (`ig2mj.worlds.core`), and all that changes is a `Batch` of one world
(`simulation.batch`); everything here only adds names to that.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.grasping import Grasping
from ig2mj.engine.base import Engine, EngineHolder, Physics, Write, whole_number
from ig2mj.engine.registry import check_options, make_engine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import PhysicsView
from ig2mj.errors import AbilityError, EngineError, StateError
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.predicates.literals import object_index
from ig2mj.predicates.logic import Atom, Expression
from ig2mj.predicates.registry import find, find_state
from ig2mj.process import entry_point, run_programs_inline
from ig2mj.process.deprecation import warn_renamed
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.setters import lacks, set_by_name
from ig2mj.scene.scene import Objects, Scene, scene_with
from ig2mj.simulation import images
from ig2mj.simulation.placing import Vector, joint_address, write_of_joint, write_of_pose
from ig2mj.simulation.recorded import Recorded
from ig2mj.simulation.robots import RobotsOfWorld, put_row
from ig2mj.simulation.sampling import WorldSampler
from ig2mj.simulation.saving import everything, first_batch, load_world, put_world, save_world
from ig2mj.states.model import DEFAULTS, StateModel
from ig2mj.states.options import StateOptions
from ig2mj.states.world import ExtendedStates, WorldState
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.core import Core
from ig2mj.worlds.plugin_states import completed
from ig2mj.worlds.rules import Rules
from ig2mj.worlds.worlds import controllers_of, grasping_of

if TYPE_CHECKING:
    from ig2mj.simulation.agent import Agent


@entry_point
class Simulation(Recorded, EngineHolder):
    """One world of a scene on any engine.

    Attributes:
      scene: the household. engine: what steps physics. core: what steps this world.
      state_options: how extended states behave; None where only physics is stepped.
      last_sampling: why candidates of the last `set_predicate` were turned down: {reason: how often}.
    """

    NO_COPY = "a simulation holds its engine, and is not pickled: sim.save(FILE) keeps it, sim.load(FILE) continues it"

    _window: Callable[[], None] | None = None

    def __init__(
        self,
        scene: Scene | str | os.PathLike,
        engine: str | Engine = "native",
        *,
        states: StateOptions | None = DEFAULTS,
        seed: int = 0,
        grasping: str | Grasping = "physical",
        objects: Objects = (),
        **options: Any,
    ):
        """Starts at the scene's initial state.

        Args:
          scene: a loaded scene, or what `load_scene` takes. engine: a name, or one made for this scene with one world.
          objects: what is added to it (see `load_scene`); not to a scene that is loaded.
          states: how extended states behave; None: physics only. seed: of what `set_state` samples at random.
          grasping: how the robots' hands hold (see `ig2mj.Worlds`).
          options: go to the engine, where it is given by name, e.g. `boxes="igibson"`.
        """
        run_programs_inline()
        check_options("Simulation", options, engine, Simulation)
        self.scene = scene_with(scene, objects)
        self.engine: Engine = make_engine(engine, self.scene, 1, **options) if isinstance(engine, str) else engine
        if self.engine.num_worlds != 1:
            raise EngineError(f"a Simulation is one world, and the engine has {self.engine.num_worlds}")
        self.state_options = states
        rules = None if states is None else Rules.of_scene(self.scene, states)
        controllers, rule = controllers_of(self.scene, ACTION_PERIOD), grasping_of(self.engine, grasping)
        self.core = Core(self.engine, rules, None, controllers, rule, True)
        self._seed = seed
        physics = self.engine.reset()
        self._initial = self.engine.export(physics, 0)
        self.last_sampling: dict[str, int] = {}
        self._robots: RobotsOfWorld | None = None
        self._batch = first_batch(self.core, physics, self._seed)

    def __repr__(self) -> str:
        return f"Simulation('{self.scene.name}', engine '{self.engine.name}')"

    @classmethod
    def from_snapshot(
        cls, scene: Scene, snapshot: Snapshot, states: ExtendedStates | None = None, **options: Any
    ) -> Simulation:
        """A simulation on the native engine that continues from one world of any engine. To look at world 1,234:

            Simulation.from_snapshot(scene, engine.export(batch.world.physics, 1234)).launch_viewer()

        Args:
          scene: that the world belongs to, with its agents.
          snapshot: without the world axis. `reset` comes back to it, with the scene's first states.
          states: extended states of that world, with a world axis of length 1; None: as the scene starts.
          options: as of the constructor.

        Raises:
          EngineError: the snapshot is of another scene.
        """
        simulation = cls(scene, **options)
        simulation.physics = simulation.engine.load(simulation.physics, snapshot)
        simulation._initial = simulation.engine.export(simulation.physics, 0)
        if states is not None:
            simulation._put(states=completed(states, simulation._rules.initial))
        return simulation

    @property
    def batch(self) -> Batch:
        """This world as a batch of one, for `core` and for functions of batches.

            simulation.batch, status = simulation.core.step(simulation.batch)

        Steps of a simulation raise no flags: a world that is no longer finite is an error.
        """
        return dataclasses.replace(self._batch, world=self._world)

    @batch.setter
    def batch(self, batch: Batch) -> None:
        self._batch = batch

    def _put(self, *, controllers: Any = None, grasps: Any = None, **fields: Any) -> None:
        """Replaces fields of the world, and what controllers remember and hands hold where it is given."""
        world = dataclasses.replace(self._batch.world, **fields)
        own = {"controllers": controllers, "grasps": grasps}
        given = {name: value for name, value in own.items() if value is not None}
        self._batch = dataclasses.replace(self._batch, world=world, **given)

    @property
    def physics(self) -> Physics:
        """The engine's state of this world as it is now, also after a step that Ctrl-C or an error ended.

        A handle taken from here is stale after the next step. Another one may be assigned, of the same engine; hands
        then hold what its constraints say.
        """
        return self.engine.current(self._batch.world.physics)

    @physics.setter
    def physics(self, physics: Physics) -> None:
        self._put(physics=physics, grasps=self.core.hands.after_load(physics, self._batch.grasps))

    @property
    def time(self) -> float:
        """Simulated seconds since the reset."""
        return float(np.asarray(self.engine.time(self.physics))[0])

    @property
    def view(self) -> PhysicsView:
        """Everything that states and predicates know of physics; world axis of length 1."""
        return self.core.cameras.placed(self.engine.view(self.physics), self._batch.controllers)

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model of this world."""
        return self.engine.to_mujoco(self.physics, 0)[0]

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of this world: live on the native engine (call `forward` after changing it), else a copy."""
        return self.engine.to_mujoco(self.physics, 0)[1]

    @property
    def robots(self) -> RobotsOfWorld:
        """The scene's robots: `simulation.robots.act(action)` lets them act, `.holding` says what their hands hold."""
        if self._robots is None:
            self._robots = RobotsOfWorld(self)
        return self._robots

    @property
    def agent(self) -> Agent:
        """The only robot: `simulation.agent.do("grasp", "apple_0")`; of several, `simulation.robots[NAME]`.

        Raises:
          EngineError: there is none, or there are several. PlanningError: its motion cannot be planned.
        """
        from ig2mj.simulation.agent import only_agent

        return only_agent(self)

    @property
    def _rules(self) -> Rules:
        if self.core.rules is None:
            raise StateError("this simulation steps physics only; make it with states=StateOptions()")
        return self.core.rules

    @property
    def state_model(self) -> StateModel:
        """Constants of the states."""
        return self._rules.model

    @property
    def states(self) -> ExtendedStates:
        """Extended states; world axis of length 1."""
        _ = self._rules
        return self._batch.world.states

    @property
    def world(self) -> WorldState:
        """Everything of this world, as compiled expressions and environments take it."""
        _ = self._rules
        return self._world

    @property
    def _world(self) -> WorldState:
        seconds = self._batch.world.step * (self.engine.substeps * self.engine.timestep)
        return dataclasses.replace(
            self._batch.world, physics=self.physics, view=self.view, time=np.asarray(seconds, np.float32)
        )

    # Time.

    def prepare(self) -> None:
        """Compiles what the first step needs, without taking it."""
        self.core.prepare(self.physics, self._batch.world.states)

    def start(self, seed: int = 0) -> PhysicsView:
        """The scene's initial state, with another seed of what `set_state` samples at random."""
        self._seed = seed
        return self.reset()

    def __copy__(self) -> Simulation:
        """As `fork`: two simulations never share a world."""
        return self.fork()

    def __deepcopy__(self, memo: dict[int, Any]) -> Simulation:
        """As `fork`."""
        return self.fork()

    def fork(self) -> Simulation:
        """An independent simulation of the same world, which continues as this one does."""
        new = super().__copy__()
        new._recorder, new._window, new.last_sampling = None, None, dict(self.last_sampling)
        new._robots = None
        new._put(physics=self.engine.fork(self.physics))
        return new

    def reset(self) -> PhysicsView:
        """Back to the scene's initial state."""
        self._robots, self._batch = (
            None,
            first_batch(self.core, self.engine.load(self.physics, self._initial), self._seed),
        )
        return self.view

    def step(self, ctrl: Vector | None = None, count: int = 1) -> PhysicsView:
        """Takes `count` control steps.

        Args:
          ctrl: [nu] controls of the agents' actuators; None keeps the last ones.

        Raises:
          EngineError: ctrl has another length than the model has actuators, or `count` is no whole number.
          LostWorldError: the world is no longer finite; nothing changes it but `reset` and what loads another.
        """
        count, row = whole_number("count", count, 0), None if ctrl is None else np.asarray(ctrl, np.float64)
        if row is not None and not row.ndim:
            raise EngineError(f"step({ctrl}): the first argument is ctrl; a number of steps is step(count={ctrl})")
        if row is not None and row.shape != (self.scene.model.nu,):
            raise EngineError(
                f"ctrl has shape {row.shape}; scene '{self.scene.name}' has {self.scene.model.nu} actuators"
            )
        row = None if row is None else row[None]
        if (window := self._window) is None:
            return self._steps(row, count)
        view = self.view
        for k in range(count):
            view = self._steps(None if k else row, 1)
            window()
        return view

    def _steps(self, row: np.ndarray | None, count: int) -> PhysicsView:
        """`step`, checked."""
        view = self.view
        step, rest = self.core.physics_step, self.core.after_physics  # an interrupted step keeps its physics
        batch, physics, done = self._batch, self.physics, 0
        world, controllers, grasps = batch.world, batch.controllers, batch.grasps
        states, before = world.states, int(world.step[0])
        if (recorder := self._recorder) is not None:
            recorder.begin()
        try:
            for done in range(1, count + 1):
                physics, view = step(physics, row)
                physics, view, states, _, grasps = rest(physics, view, states, controllers, grasps)
                row = None
                if recorder is not None:
                    recorder.add(physics, states, before + done, grasps)
        finally:
            after = WorldState(
                physics=physics, view=view, states=states, key=world.key, step=world.step + done, time=world.time
            )
            self._batch = dataclasses.replace(batch, world=after, grasps=grasps)
        return view

    def forward(self) -> PhysicsView:
        """Brings everything derived up to date without passing time."""
        return self._write(Write())

    def _write(self, write: Write) -> PhysicsView:
        self._put(physics=self.engine.write(self.physics, write))
        return self._written(write)

    def _written(self, write: Write) -> PhysicsView:
        """The view after a write to physics, or a cut; hands let go of what it moved."""
        view = self.view
        self._put(grasps=self.core.hands.after_write(self.physics, view, self._batch.grasps, write))
        return view

    # Objects and joints.

    def object_pose(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Frame of an object's main body: position [3] (m) and quaternion [4] (w-x-y-z), world frame."""
        index, view = self.scene.object_index(name), self.view
        return np.array(view.object_pos[0, index], np.float64), np.array(view.object_quat[0, index], np.float64)

    def set_object_pose(self, name: str, pos: Vector, quat_wxyz: Vector | None = None) -> PhysicsView:
        """Puts an object somewhere, at rest and awake.

        Args:
          pos: [3] m, world frame, of the main body's frame.
          quat_wxyz: [4], of any length but zero; None keeps the rotation.

        Raises:
          UnknownNameError: no such object. PoseError: it is fixed, or the pose is invalid.
        """
        quat = self.object_pose(name)[1] if quat_wxyz is None else quat_wxyz
        return self._write(write_of_pose(self.scene, name, pos, quat))

    def joint(self, name: str) -> float:
        """Position of a hinge (rad) or slide (m). Raises UnknownNameError; PoseError for a free joint."""
        return float(self.data.qpos[joint_address(self.scene, name)])

    def set_joint(self, name: str, q: float | int) -> PhysicsView:
        """Puts a hinge (rad) or slide (m) somewhere, at rest and awake.

        Raises:
          UnknownNameError: no such joint. PoseError: it is a free joint, or q is not finite or beyond its range.
        """
        return self._write(write_of_joint(self.scene, name, q))

    # States and predicates.

    def state(self, name: str, object_name: str | None = None) -> Any:
        """A state of one object, or of every object that has it: {object: value}.

        Args:
          name: see `ig2mj.states.registry.STATES`.
          object_name: halves of a sliced object are objects of their own.

        Raises:
          UnknownNameError: no such state or object; StateError: a predicate. AbilityError: the object does not have it.
        """
        kind, model, view = find_state(name), self.state_model, self.view
        if object_name is not None:
            index = object_index(model, object_name)
            if not kind.belongs_to(model, index) and not kind.of_substances:  # whose `get` says what is missing
                raise AbilityError(lacks(f"state '{kind.name}'", object_name, model, kind.abilities or ()))
            return kind.get(model, self.states, view, index, 0)
        names = self.scene.object_names
        having = [o for o in range(len(names)) if kind.belongs_to(model, o)]
        return {names[o]: kind.get(model, self.states, view, o, 0) for o in having}

    def set_state(self, name: str, object_name: str, value: bool | float | int) -> None:
        """Sets a state, or makes a predicate of one object true or false as the paper samples it (table A.5).

        Args:
          name: temperature, max_temperature or wetness, with a number; or cooked, burnt, frozen, soaked,
            dusty, stained, toggled_on, open, or sliced (only True).
          object_name: its halves, where it has some, are set alike.

        Raises:
          UnknownNameError, AbilityError: as for `state`. StateError: it cannot be set, or a door would shove something.
        """
        key, own = jax.random.split(jax.random.wrap_key_data(jnp.asarray(self._batch.world.key[0])))
        change = set_by_name(self.state_model, self.states, self.view, name, object_name, value, own)
        self._put(states=change.states, key=np.asarray(jax.random.key_data(key))[None])
        if change.swap is not None:
            self._put(physics=self.core.teleport(self.physics, self.view, change.swap)[0])
            self._written(Write())
        if change.joints is not None:
            now = self.engine.export(self.physics, 0)
            self._write(self._sampler.write_of_joints(change, now, self.states, object_name, bool(value), own))

    def set_predicate(self, name: str, *arguments: str, value: bool = True, seed: int = 0) -> bool:
        """Makes a predicate true or false by sampling, as table A.5 of the paper says, and lets the world come to rest.

        `set_predicate("on_top", "plate_0", "breakfast_table_0")` puts the plate somewhere on the table.

        Args:
          seed: the same seed in the same world gives the same result.

        Returns:
          Whether it was done. If not, the world is as it was, and `last_sampling` counts the reasons.

        Raises:
          UnknownNameError, ArityError: no such predicate, object or room, or too many or few. AbilityError: the object
          lacks the ability. StateError: it can never be made so, because the object is fixed, for instance.
        """
        condition = Condition(find(name).name, _names(name, arguments), value)
        now = self.engine.export(self.physics, 0)
        row = self._sampler.sample(condition, now, self.states, seed, Budget())
        self.last_sampling = dict(self._sampler.rejected)
        if row is not None:
            put_row(self, row)
        return row is not None

    @functools.cached_property
    def _sampler(self) -> WorldSampler:
        return WorldSampler(self.scene, self.state_model)

    def predicate(self, name: str, *arguments: str, strict: bool = False) -> bool:
        """Whether a predicate holds now, e.g. `predicate("on_top", "plate_0", "coffee_table_0")`.

        Raises:
          UnknownNameError: no such predicate, object or room. ArityError: too many or too few arguments.
          AbilityError: with `strict`, the object lacks the ability; otherwise that is False.
        """
        return self.holds(Atom(name, _names(name, arguments)), strict=strict)

    def holds(self, expression: Expression | str, strict: bool = False) -> bool:
        """Whether an expression holds now; text as `ig2mj.predicates.parse` reads it. Raises ExpressionError, and as
        `predicate`."""
        return bool(self.compiled(expression, strict)(self.world)[0])

    def compiled(self, expression: Expression | str, strict: bool = False) -> CompiledExpression:
        """An expression compiled for this scene, to be asked again and again: `compiled(goal)(simulation.world)`."""
        return self._rules.compiled(expression, strict)

    def explain(self, expression: Expression | str) -> str:
        """Whether an expression holds now, and what is missing where it does not."""
        return self.compiled(expression).explain(self.world)

    # Files.

    def save(self, path: str | os.PathLike) -> None:
        """Writes the whole world, physics and states, to one `.npz` (arrays only, no pickle). Raises InputError."""
        save_world(everything(self), path, self.scene, self.engine.name)

    def load(self, path: str | os.PathLike) -> PhysicsView:
        """Goes back to a world that `save` wrote, of this scene. Raises InputError."""
        return put_world(self, load_world(path, everything(self), self.scene, self._rules.initial))

    def restore(self, path: str | os.PathLike) -> PhysicsView:
        """Deprecated: `load`."""
        warn_renamed("Simulation.restore", "Simulation.load")
        return self.load(path)

    # Images.

    def render(self, camera: Any = None, *, width: int = 640, height: int = 480, **options: Any) -> np.ndarray:
        """An image, uint8 [height, width, 3]; objects are tinted by state, dust, stains and water are drawn.

        Args:
          camera: a camera's name or number, an `ig2mj.viewer.offscreen.FreeView`, or None for an overview.
          options: see `ig2mj.viewer.offscreen.render`.
        """
        return images.render(self, camera, width, height, **options)

    def launch_viewer(self, **options: Any) -> None:
        """Opens MuJoCo's viewer on this world and steps it until the window is closed.

        Args:
          options: `overlays`, `paused`; see `ig2mj.viewer.interactive.open_viewer`.

        Raises:
          MissingDependencyError: there is no display.
        """
        images.launch_viewer(self, **options)

    @contextlib.contextmanager
    def viewer(self, **options: Any) -> Iterator[None]:
        """Opens MuJoCo's viewer; during the block every step of this world is seen in it, in real time.

            with simulation.viewer():
                simulation.agent.do("grasp", "apple_0")

        Args:
          options: `overlays`; see `ig2mj.viewer.interactive.open_viewer`.

        Raises:
          MissingDependencyError: there is no display.
        """
        with images.viewer(self, **options) as window:
            self._window = window
            try:
                yield
            finally:
                self._window = None


def _names(predicate: str, arguments: tuple[str, ...]) -> tuple[str, ...]:
    """Arguments of a predicate. Raises StateError: one is no name."""
    for given in arguments:
        if not isinstance(given, str):
            raise StateError(f"predicate '{predicate}': {given!r} is no name (its truth is value=True or value=False)")
    return arguments
