"""`Simulation`: one world, for people: step it, move things by name, ask what is true of it, look at it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from ig2mj.engine.base import Engine, Snapshot, Write
from ig2mj.engine.registry import make_engine
from ig2mj.engine.view import PhysicsView
from ig2mj.errors import EngineError, PoseError, UnknownNameError
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.simulation_states import SimulationStates
from ig2mj.states.model import DEFAULTS
from ig2mj.states.options import StateOptions
from ig2mj.states.world import ExtendedStates

Vector = Sequence[float | int] | np.ndarray


class Simulation(SimulationStates):
    """One world of a scene on any engine.

    Attributes:
      scene: the household. engine: what steps it. physics: the engine's state; use what the methods give instead.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike,
        engine: str | Engine = "native",
        *,
        states: StateOptions | None = DEFAULTS,
        seed: int = 0,
        **options: Any,
    ):
        """Starts at the scene's initial state.

        Args:
          scene: a loaded scene, or what `load_scene` takes.
          engine: an engine's name, or an engine made for this scene with one world.
          states: how extended states behave; None: physics only.
          seed: of what `set_state` draws at random.
          options: go to the engine, where it is given by name, e.g. `boxes="igibson"`.
        """
        self.scene = scene if isinstance(scene, Scene) else load_scene(scene)
        self.engine: Engine = make_engine(engine, self.scene, 1, **options) if isinstance(engine, str) else engine
        if self.engine.num_worlds != 1:
            raise EngineError(f"a Simulation is one world, and the engine has {self.engine.num_worlds}")
        self.physics = self.engine.reset()
        self._initial = self.engine.export(self.physics, 0)
        self._start_states(states, seed)

    @classmethod
    def from_snapshot(
        cls, scene: Scene, snapshot: Snapshot, states: ExtendedStates | None = None, **options: Any
    ) -> Simulation:
        """Goes on, on the native engine, from a world of another one: how to look at world 1,234 of a batch.

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
            assert simulation.states is not None  # made at the first question
            simulation._states = states
        return simulation

    @property
    def time(self) -> float:
        """Simulated seconds since the reset."""
        return float(np.asarray(self.engine.time(self.physics))[0])

    @property
    def view(self) -> PhysicsView:
        """Everything that states and predicates know of physics; world axis of length 1."""
        return self.engine.view(self.physics)

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model of this world."""
        return self.engine.to_mujoco(self.physics, 0)[0]

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of this world: live on the native engine (call `forward` after changing it), else a copy."""
        return self.engine.to_mujoco(self.physics, 0)[1]

    def reset(self) -> PhysicsView:
        """Back to the scene's initial state."""
        self.physics = self.engine.load(self.physics, self._initial)
        self._reset_states()
        return self.view

    def step(self, ctrl: Vector | None = None, count: int = 1) -> PhysicsView:
        """Takes `count` control steps.

        Args:
          ctrl: [nu] controls of the agents' actuators; None keeps the last ones.

        Raises:
          EngineError: ctrl has another length than the model has actuators, or the physics went wrong.
        """
        row = None
        if ctrl is not None:
            row = np.asarray(ctrl, np.float64)
            if row.shape != (self.scene.model.nu,):
                raise EngineError(
                    f"ctrl has shape {row.shape}; scene '{self.scene.name}' has {self.scene.model.nu} actuators"
                )
            row = row[None]
        view = self.view
        for _ in range(count):
            self.physics, view = self.engine.step(self.physics, row)
            view = self._step_states(view)
            row = None
        return view

    def forward(self) -> PhysicsView:
        """Brings everything derived up to date without passing time."""
        self.physics = self.engine.write(self.physics, Write())
        return self.view

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
          UnknownNameError: no such object. PoseError: it is fixed, or the pose is no pose.
        """
        index = self.scene.object_index(name)
        if self.scene.tables.object_fixed[index]:
            raise PoseError(f"object '{name}' is fixed to the house and cannot be moved (its joints can: set_joint)")
        place = _finite(pos, 3, f"position of object '{name}'")
        turn = self.object_pose(name)[1] if quat_wxyz is None else _finite(quat_wxyz, 4, f"rotation of object '{name}'")
        length = float(np.linalg.norm(turn))
        if length < 1e-6:
            raise PoseError(f"the rotation of object '{name}' is the zero quaternion (w, x, y, z is wanted)")
        number = len(self.scene.object_names)
        mask, at, to = np.zeros((1, number), bool), np.zeros((1, number, 3)), np.zeros((1, number, 4))
        mask[0, index], at[0, index], to[0, index] = True, place, turn / length
        self.physics = self.engine.write(self.physics, Write(object_mask=mask, object_pos=at, object_quat=to))
        return self.view

    def joint(self, name: str) -> float:
        """Position of a hinge (rad) or slide (m). Raises UnknownNameError; PoseError for a free joint."""
        return float(self.data.qpos[self._joint_address(name)])

    def set_joint(self, name: str, q: float | int) -> PhysicsView:
        """Puts a hinge (rad) or slide (m) somewhere, at rest and awake.

        Raises:
          UnknownNameError: no such joint. PoseError: it is a free joint, or q is not finite or beyond its range.
        """
        address = self._joint_address(name)
        place = float(_finite([q], 1, f"position of joint '{name}'")[0])
        _check_range(self.scene.model, name, place)
        mask, values = np.zeros((1, self.scene.model.nq), bool), np.zeros((1, self.scene.model.nq))
        mask[0, address], values[0, address] = True, place
        self.physics = self.engine.write(self.physics, Write(qpos_mask=mask, qpos=values))
        return self.view

    def render(self, camera: Any = None, *, width: int = 640, height: int = 480, **options: Any) -> np.ndarray:
        """A picture, uint8 [height, width, 3]; objects are tinted by state, dust, stains and water are drawn.

        Args:
          camera: a camera's name or number, an `ig2mj.viewer.offscreen.FreeView`, or None for an overview.
          options: see `ig2mj.viewer.offscreen.render`.
        """
        from ig2mj.viewer import offscreen, state_marks

        model, data = self.engine.to_mujoco(self.physics, 0)
        if self.state_options is None or options.get("segmentation"):
            return offscreen.render(model, data, camera, width=width, height=height, **options)
        found = state_marks.marks(self.state_model, self.states, self.view)
        options.setdefault("decorate", lambda scene: state_marks.draw_marks(scene, found))
        tint = state_marks.tint_of_objects(self.state_model, self.states)
        with state_marks.Tinter(model, self.scene.tables).shown(tint):
            return offscreen.render(model, data, camera, width=width, height=height, **options)

    def launch_viewer(self, **options: Any) -> None:
        """Opens MuJoCo's viewer on this world and steps it until the window is closed.

        Args:
          options: `overlays`, `paused`; see `ig2mj.viewer.interactive.open_viewer`.

        Raises:
          MissingDependencyError: there is no display.
        """
        from ig2mj.viewer import interactive, overlays, states_overlay

        if self.state_options is not None:
            shown = [*overlays.default_overlays(self.scene), states_overlay.StatesOverlay(self, self.model)]
            options.setdefault("overlays", shown)
        options.setdefault("step_time", self.engine.substeps * self.engine.timestep)
        interactive.launch(self, **options)

    def _joint_address(self, name: str) -> int:
        model = self.scene.model
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        if number < 0:
            raise UnknownNameError("joint", name, [model.joint(j).name for j in range(model.njnt)])
        if mujoco.mjtJoint(int(model.jnt_type[number])) not in (
            mujoco.mjtJoint.mjJNT_HINGE,
            mujoco.mjtJoint.mjJNT_SLIDE,
        ):
            raise PoseError(f"joint '{name}' is no hinge and no slide (use set_object_pose)")
        return int(model.jnt_qposadr[number])


def _check_range(model: mujoco.MjModel, name: str, q: float) -> None:
    """Raises PoseError where q is beyond the joint's range by more than rounding."""
    joint = model.joint(name)
    low, high = (float(v) for v in joint.range)
    slack = 1e-6 * (high - low)
    if joint.limited[0] and not low - slack <= q <= high + slack:
        unit = "rad" if int(joint.type[0]) == int(mujoco.mjtJoint.mjJNT_HINGE) else "m"
        raise PoseError(f"joint '{name}' goes from {low:.4g} to {high:.4g} {unit}; {q:.4g} is beyond its range")


def _finite(values: Vector, length: int, what: str) -> np.ndarray:
    """The values as float64 [length]. Raises PoseError."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise PoseError(f"the {what} is no list of numbers: {values!r}") from None
    if array.shape != (length,):
        raise PoseError(f"the {what} needs {length} numbers, not an array of shape {array.shape}")
    if not np.isfinite(array).all():
        raise PoseError(f"the {what} is not finite: {array.tolist()}")
    return array
