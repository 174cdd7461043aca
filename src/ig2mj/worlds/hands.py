"""`Hands`: grasping as a part of the core. What hands of all worlds take hold of and let go of after a control step.

Axes: W worlds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.agents.base import Controller
from ig2mj.agents.grasping import Grasping, GraspState
from ig2mj.engine.base import Engine, Physics, Write
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError
from ig2mj.states.definitions.attached import Joints
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.batch import select_worlds
from ig2mj.worlds.joints import JointSwitch

Held = GraspState | None
"""What hands hold; None where they hold by friction alone."""


def check_grasping(engine: Engine, grasping: Grasping | None) -> None:
    """Raises EngineError where hands hold by constraints and the engine cannot ignore contacts of what is held."""
    if grasping is not None and grasping.active and engine.cannot_ignore:
        raise EngineError(
            f"grasping '{grasping.mode}' ignores contacts of what is held, which engine '{engine.name}' cannot: "
            f"{engine.cannot_ignore} (take engine='native' or grasping='physical')"
        )


class Hands:
    """The hands of an engine's worlds. `act` and `read` may be part of a compiled program."""

    def __init__(
        self,
        engine: Engine,
        grasping: Grasping | None,
        controllers: Sequence[Controller],
        joints: Joints | None = None,
    ):
        """Binds a rule of grasping to an engine and to the controllers that ask hands to close.

        Args:
          joints: what can be attached in the scene.

        Raises:
          EngineError: the engine cannot hold by that rule; see `check_grasping`.
        """
        check_grasping(engine, grasping)
        self._engine, self._grasping, self._controllers = engine, grasping, tuple(controllers)
        self._holds = grasping is not None and grasping.active
        self._nothing = np.zeros(engine.num_worlds, bool)
        self._joints = JointSwitch.of(engine, joints)
        self._update = engine.compile(self._updated, self._idle)
        if grasping is not None:
            self._constraints, self._read = engine.compile(grasping.write), engine.compile(grasping.read)
            self._ended, self._loaded = engine.compile(grasping.ended), engine.compile(grasping.loaded)

    def act(
        self, physics: Physics, view: PhysicsView, held: Held, controllers: tuple[Any, ...], states: Any = None
    ) -> tuple[Physics, PhysicsView, Held]:
        """Physics, view and grasps after hands took hold or let go. Consumes `physics`.

        Args:
          states: in which what is attached stays so.
        """
        if not self._holds or held is None:
            return physics, view, held
        assert self._grasping is not None
        after, changed = self._update(view, held, controllers)

        def constrain(physics: Physics, view: PhysicsView) -> tuple[Physics, PhysicsView]:
            write = self._constraints(after)
            if self._joints is not None:
                write = self._joints.joined(write, states)
            return self._engine.write_with_view(physics, write, view)

        physics, view = self._engine.when_any(changed, constrain, physics, view, cheap=True)
        return physics, view, after

    def join(
        self, physics: Physics, view: PhysicsView, held: Held, before: ExtendedStates, after: ExtendedStates
    ) -> tuple[Physics, PhysicsView]:
        """Physics and view after the constraints of what the states attach, or no longer do. Consumes `physics`."""
        if self._joints is None:
            return physics, view
        joints, worlds = self._joints, self._engine.num_worlds

        def switch(physics: Physics, view: PhysicsView) -> tuple[Physics, PhysicsView]:
            return self._engine.write_with_view(physics, self._joined(held, worlds, after), view)

        return self._engine.when_any(joints.changed(before, after), switch, physics, view, cheap=True)

    def _joined(self, held: Held, worlds: int, states: ExtendedStates) -> Write:
        """All constraints: what hands hold, and what is attached."""
        assert self._joints is not None
        if self._holds and held is not None:
            return self._joints.joined(self._constraints(held), states)
        return self._joints.joined(self._joints.none_held(worlds), states)

    def _idle(self, view: PhysicsView, held: GraspState, controllers: tuple[Any, ...]) -> tuple | None:
        """What `_updated` returns where no hand can hold or let go of anything."""
        assert self._grasping is not None
        return (held, self._nothing) if self._grasping.idle(view, held) else None

    def read(self, physics: Physics) -> Held:
        """What hands hold in worlds by themselves: the constraints that are on."""
        if self._grasping is None:
            return None
        if not self._holds:
            return self._grasping.initial(self._engine.num_worlds)
        now = self._engine.snapshot(physics)
        return self._read(now.whole("eq_active"), now.whole("eq_data"), now.agents.ignored_contacts)

    def after_write(self, physics: Physics, view: PhysicsView, held: Held, write: Write) -> Held:
        """What hands hold after a write from outside: grasps that it ended are over.

        Args:
          physics, view: after the write. held: before it.
        """
        if not self._holds or held is None:
            return held
        return self._ended(held, view.held) if write.eq_active is None else self.after_load(physics, held)

    def after_load(self, physics: Physics, held: Held, mask: Bool[Array, "W"] | None = None) -> Held:
        """What hands hold after worlds were loaded: the grasps that these brought along.

        Args:
          held: before. mask: the worlds that were loaded; None: all.
        """
        if not self._holds or held is None:
            return self.read(physics)
        found = self._loaded(held, self.read(physics))
        return found if mask is None else select_worlds(jnp.asarray(mask), found, held)

    def _updated(
        self, view: PhysicsView, held: GraspState, controllers: tuple[Any, ...]
    ) -> tuple[GraspState, Bool[Array, "W"]]:
        """What hands hold after a step, and the worlds in which that has changed."""
        assert self._grasping is not None
        each = list(zip(self._controllers, controllers, strict=True))
        grip = jnp.concatenate([c.grip(state) for c, state in each], axis=1)
        lag = jnp.concatenate([c.lag(view, state) for c, state in each], axis=1)
        after = self._grasping.update(view, held, grip, lag)
        return after, self._grasping.changed(held, after)
