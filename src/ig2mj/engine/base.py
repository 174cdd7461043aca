"""The `Engine` protocol: what every physics engine offers to the parts above it, and the data it takes and returns.

Nothing above this package asks which engine it has (`tests/test_one_stepping_core.py`). Engines differ in two ways:

- *What physics is.* MJX engines have a `Physics` that is a pytree; `reset`, `step`, `view`, `write`, `load`, `health`
  and `snapshot` can be traced and return new pytrees. The native engine (C MuJoCo) changes its worlds in place: `step`,
  `write` and `load` return a new handle, and every later use of an older handle raises StaleStateError. Code that
  always continues with the returned physics is correct for both. `fork` returns an independent copy.
- *How functions run.* MJX engines run a whole control step as one compiled program. Next to the native engine the same
  functions run in Python, and their pure parts are compiled. The parts above say what a function is (`compile`,
  `program`) and write branches and loops with `when_any` and `repeat`; the engine decides the rest.

`num_worlds` is fixed when the engine is made.

Axes: W worlds, O objects, H hands, B bodies, U units (see `ig2mj.engine.layout`), E equality constraints, nq, nv, nu,
na as in MuJoCo.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Protocol, runtime_checkable

import mujoco
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.health import Health
from ig2mj.engine.model_fields import MOVING, ModelFields, given
from ig2mj.engine.saved import SavedPhysics
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError
from ig2mj.process.gc_pause import Traced
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import SceneTables

GATHERED = (1, 8, 64, 256, 1024)
"""Numbers of worlds that `Engine.gather` is compiled for where it is compiled."""

PHYSICS_TIMESTEP = 1 / 120
"""Seconds. iGibson's physics step."""

SUBSTEPS = 4
"""Physics steps in a control step: iGibson renders and acts at 30 Hz."""

TOUCH_TOLERANCE = 0.003
"""Metres. Surfaces this close touch (measured in PyBullet)."""

BOX_RULES = ("tight", "igibson")
"""How `aabb_low` and `aabb_high` are made.

"tight": smallest world box around the collision geometry. "igibson": each body's box in its own frame, rotated into the
world and enclosed, plus Bullet's margin (iGibson's aabb.py).
"""


def whole_number(name: str, value: Any, least: int = 1) -> int:
    """The value of an argument as an int. Raises EngineError: it is not a whole number, or less than `least`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise EngineError(f"{name} = {value!r}: a whole number of at least {least} is needed")
    return int(value)


def check_arguments(boxes: str, num_worlds: int, substeps: int, timestep: float) -> None:
    """Checks the arguments that all engines have. Raises EngineError."""
    if boxes not in BOX_RULES:
        raise EngineError(f"there is no box rule '{boxes}' (rules: {', '.join(BOX_RULES)})")
    whole_number("num_worlds", num_worlds)
    whole_number("substeps", substeps)
    if isinstance(timestep, bool) or not isinstance(timestep, float | int | np.number) or not timestep > 0:
        raise EngineError(f"timestep = {timestep!r}: seconds, more than 0")


Physics = Any
"""An engine's physics state of all worlds; opaque to everyone but the engine."""


@struct.dataclass
class Write:
    """A change to physics that is not simulated: teleports, joint positions, grasps. Leave out (None) what stays.

    What is written moves at once, its velocity becomes zero, and it wakes together with the sleeping island it is part
    of. A fixed object cannot be moved: its row of `object_mask` is ignored. A write of nothing at all brings the view
    up to date with what someone changed in MuJoCo's own structures (`Engine.to_mujoco`).

    A grasp ends when the write moves the held body or the hand, by teleport or by any coordinate of a joint between one
    of them and the world: its constraint is switched off and its contacts are no longer ignored, before anything moves.
    The native engine does the same with what someone moved in MuJoCo's own structures, at the write of nothing that
    follows. A write that gives `eq_active` decides itself what stays held.

    Attributes:
      object_mask, object_pos, object_quat: teleports of objects: frame of the main body, world frame, w-x-y-z. Bodies
        that hang on the object by no joint (split-off floating links) go along rigidly.
      qpos_mask, qpos: single coordinates, at MuJoCo's addresses (joints). Applied after the teleports.
      eq_active: the whole of it.
      model_fields: fields of the model that are the world's own from now on; the whole of each that is given. Where
        masses or friction change, everything in the world wakes.
      ignored_contacts: contacts between a hand's bodies (its palm and its fingers) and an object are dropped after the
        narrow phase, from now on, until it is written again: they give neither forces nor touch, and wake nothing.
        Contacts of all other pairs stay exactly as they were. What is ignored no more is touched again from the next
        step on (on the native engine at once).

    A write of constraints (`eq_active`, `eq_data`) and `ignored_contacts` alone moves nothing, and MJX engines do it
    without a forward pass.
    """

    object_mask: Bool[Array, "W O"] | None = None
    object_pos: Float[Array, "W O 3"] | None = None
    object_quat: Float[Array, "W O 4"] | None = None
    qpos_mask: Bool[Array, "W nq"] | None = None
    qpos: Float[Array, "W nq"] | None = None
    eq_active: Bool[Array, "W E"] | None = None
    model_fields: ModelFields | None = None
    ignored_contacts: Bool[Array, "W H O"] | None = None

    @property
    def moves_nothing(self) -> bool:
        """Only constraints, ignored contacts and fields that no position depends on are written."""
        teleports = self.object_mask is not None or self.qpos_mask is not None
        return not teleports and {*MOVING[1:]}.isdisjoint(given(self.model_fields))


@runtime_checkable
class Engine(Protocol):
    """Physics of `num_worlds` worlds that share one scene.

    Attributes:
      name: "native", "warp" or "jax".
      pure: a control step can be part of a compiled program of the caller's (see the module's text). For refusals, by
        `check_pure`; to run a function use `compile` and `program`.
      live: `to_mujoco` returns the structures that the engine steps, not copies.
      reproducible: the same actions from the same state give the same bits, on any machine of the same kind.
      tracks_changes: while nothing changes, views hold the same arrays, so that `is` tells what can be skipped.
      renderer: what makes images of its worlds, a key of `ig2mj.sensors.suite.CAMERAS`; "" where nothing does.
      num_worlds: W.
      scene, tables: what is simulated, and its constants.
      substeps, timestep: a control step is `substeps` physics steps of `timestep` seconds.
      cannot_ignore: why this engine refuses `Write.ignored_contacts`, which all grasping but "physical" needs; ""
        where it does not.
      frame_cuts: where the leaves of a `Snapshot` are in the arrays that `frame` gives of each world
        (`ig2mj.engine.native.recorded.Cut`); empty where it gives none of single worlds.
    """

    name: str
    pure: bool
    live: bool
    reproducible: bool
    tracks_changes: bool
    renderer: str
    num_worlds: int
    scene: Scene
    tables: SceneTables
    substeps: int
    timestep: float

    @property
    def cannot_ignore(self) -> str: ...

    @property
    def frame_cuts(self) -> Sequence[Any]: ...

    # How functions run.

    def compile(self, function: Callable[..., Any], shortcut: Callable[..., Any] | None = None) -> Callable[..., Any]:
        """A pure function of pytrees of arrays (views, states), to be called alone or in functions of `program`.

        Args:
          shortcut: a function of the same arguments on NumPy arrays that returns the result in the frequent case, at a
            fraction of the cost, and None otherwise. Not used where values are not known, in a traced program.
        """
        ...

    def program(
        self, function: Callable[..., Any], check: Callable[[Any], None] | None = None, **options: Any
    ) -> Callable[..., Any]:
        """A function that uses physics: steps, writes, views. One compiled program where physics can be traced.

        Args:
          check: called with the first argument before each call. options: of `jax.jit`, such as `donate_argnums`.
        """
        ...

    def when_any(self, mask: Bool[Array, "W"], act: Callable[..., Any], *operands: Any, cheap: bool = False) -> Any:
        """`act(*operands)` if any world is masked, else the operands (a single one as itself).

        Args:
          act: changes nothing of a world that is not masked.
          cheap: a compiled program is to call `act` always, since a branch would cost more.
        """
        ...

    def repeat(self, body: Callable[[Any], tuple[Any, Any]], carry: Any, length: int) -> tuple[Any, Any]:
        """Calls `body(carry) -> (carry, result)` `length` times, at least once; the last carry and the last result."""
        ...

    def constants(self, tree: Any) -> Any:
        """Arrays as functions of this engine read them fastest: NumPy's, or on the device in single precision."""
        ...

    def kept(self, tree: Any) -> Any:
        """Arrays of a result that no later step changes or consumes."""
        ...

    def kept_row(self, tree: Any, world: int) -> tuple[Any, int]:
        """`kept` for one world of a pytree of arrays [W, ...]: a pytree of some worlds, and the world's row in it."""
        ...

    def copied(self, tree: Any) -> Any:
        """An independent copy of a pytree that may hold physics, such as a batch. Not traced."""
        ...

    def with_eyes(self, view: PhysicsView, poses: Callable[[], tuple[Array, Array]]) -> PhysicsView:
        """The view with other poses of the agents' cameras: `poses` returns [W, A, 3] m and [W, A, 4] w-x-y-z."""
        ...

    def write_with_view(
        self, physics: Physics, write: Write, before: PhysicsView, worlds: Bool[Array, "W"] | None = None
    ) -> tuple[Physics, PhysicsView]:
        """`write`, and the view after it.

        Args:
          before: view of `physics`. worlds: those that are written to; the others keep their view. None: all.
        """
        ...

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Allocates memory on other devices of this process, before programs run there."""
        ...

    def pending_reset_program(self) -> Traced | None:
        """The traced program of `reset` while kernels are still being compiled or loaded in the background, so that
        the caller can compile programs meanwhile; else None. It is given once."""
        ...

    # Physics.

    def reset(self) -> Physics:
        """All worlds at the scene's initial state (its first keyframe, else its zero pose), everything awake.

        Raises:
          EngineError: something that steps need could not be compiled.
        """
        ...

    def first_world(self) -> tuple[Snapshot, PhysicsView]:
        """What `reset` makes of one world, in numpy arrays: its snapshot without the world axis, and its view (W = 1).

        Never traced, and nothing is compiled for it.
        """
        ...

    def step(self, physics: Physics, ctrl: Float[Array, "W nu"] | None = None) -> tuple[Physics, PhysicsView]:
        """One control step of every world.

        Args:
          physics: as returned by the last call.
          ctrl: controls held during the step; None keeps those of the step before. Those beyond 1e6 are clipped, NaNs
            keep the value of before; `Health.wrong_controls` reports both.

        Returns:
          The physics after the step and its view: poses, contacts and boxes of the same instant, forces of the steps
          that led to it.

        Raises:
          EngineError: the controls have another shape.
          LostWorldError: (native engine) a world is no longer finite, and stays so until it is loaded. The others
            were stepped, and go on with the same physics.
        """
        ...

    def view(self, physics: Physics) -> PhysicsView:
        """The view of the present state. After `step` the same as it returned; after `write`, with no forces."""
        ...

    def time(self, physics: Physics) -> Float[Array, "W"]:
        """Simulated seconds since each world's reset."""
        ...

    def write(self, physics: Physics, write: Write) -> Physics:
        """Applies a change and brings everything derived up to date; what it moves wakes."""
        ...

    def health(self, physics: Physics) -> Health:
        """What went wrong in each world since it was loaded; see `ig2mj.engine.health`."""
        ...

    def snapshot(self, physics: Physics) -> Snapshot:
        """All worlds as a snapshot with the world axis."""
        ...

    def export(self, physics: Physics, world: int) -> Snapshot:
        """One world as a snapshot without the world axis, in numpy arrays that share no memory with the engine."""
        ...

    def gather(self, physics: Physics, tree: Any, worlds: Sequence[int]) -> Callable[[], tuple[Snapshot, Any]]:
        """Begins to copy some worlds to the host.

        Args:
          physics: as returned by the last call.
          tree: arrays [W, ...] that go with it.
          worlds: numbers of k of them, at least one.

        Returns:
          a function that waits for their snapshots, and rows of the tree, and returns them in numpy arrays [k, ...] of
          their own. The next step may begin before it is called.
        """
        ...

    def load(self, physics: Physics, snapshot: Snapshot, mask: Bool[Array, "W"] | None = None) -> Physics:
        """Replaces worlds by snapshots.

        Args:
          physics: as returned by the last call.
          snapshot: with the world axis: row w goes to world w. Without it: goes to every world. One of the bare scene
            leaves the agents at their start.
          mask: the worlds to replace; None: all.
        """
        ...

    def check(self, physics: Physics) -> None:
        """Raises StaleStateError: the physics was consumed by a later step, reset, write or load, in place or since its
        arrays were donated to a program. All methods that take physics raise it as well. Nothing while tracing."""
        ...

    def current(self, physics: Physics) -> Physics:
        """Physics to go on with where a call did not return: on the native engine the worlds as that call left them,
        whatever the handle stands for; on others the same physics."""
        ...

    def fork(self, physics: Physics) -> Physics:
        """An independent copy, which goes on as the original would. The original stays valid. Not traced.

        Raises:
          StaleStateError: the physics was consumed.
        """
        ...

    def saved(self, physics: Physics) -> SavedPhysics:
        """All worlds in NumPy arrays that share no memory with the engine; see `restored`. Not traced.

        Raises:
          StaleStateError: the physics was consumed.
        """
        ...

    def restored(self, saved: SavedPhysics) -> Physics:
        """New worlds that continue from saved ones, of this engine or of another one. Not traced.

        Raises:
          EngineError: they are of another scene, of other agents or of another number of worlds.
        """
        ...

    def restored_view(self, physics: Physics, saved: SavedPhysics) -> PhysicsView:
        """The view of restored physics: the saved one, to the bit, forces included."""
        ...

    def frame(self, physics: Physics, worlds: Sequence[int]) -> tuple[list[list[np.ndarray]], list[np.ndarray]]:
        """All of physics for a recording, in arrays that are not changed later.

        Returns:
          Arrays of each given world, cut by `frame_cuts`; and the leaves of a `Snapshot` of all worlds. One of the two
          is empty.
        """
        ...

    def to_mujoco(self, physics: Physics, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """One world as MuJoCo's own structures, kinematics up to date, for viewers and renderers; never traced.

        Live engines (`live`) return those that they step: forces put on them act in the next step. Others return
        copies.
        """
        ...


class EngineHolder:
    """Mixin of what holds an engine: `copy.copy` gives another object on it; `copy.deepcopy` and `pickle` raise
    EngineError, since a copy would share what the engine steps. States of worlds are copied instead (`fork`, `save`).
    """

    NO_COPY: ClassVar[str] = "it holds its engine, and is neither copied nor pickled"
    """Of the error: why, and what is done instead."""

    def __copy__(self) -> Any:
        """Another object on the same engine."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        """Raises EngineError."""
        raise EngineError(f"{self!r}: {self.NO_COPY}")

    def __reduce__(self) -> Any:
        """Raises EngineError."""
        raise EngineError(f"{self!r}: {self.NO_COPY}")


def check_pure(engine: Engine, error: Exception) -> None:
    """Raises the error where a control step of the engine cannot be part of a compiled program of the caller's."""
    if not engine.pure:
        raise error
