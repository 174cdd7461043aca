"""Copies of physics that is a pytree: forks, and worlds in arrays of NumPy and back."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.mjx.physics import MjxPhysics, fresh
from ig2mj.engine.saved import SavedPhysics, copied
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array, PhysicsView


class MjxCopies(abc.ABC):
    """What an MJX engine does about copies; see `ig2mj.engine.base.Engine`."""

    num_worlds: int

    @abc.abstractmethod
    def reset(self) -> MjxPhysics: ...

    @abc.abstractmethod
    def view(self, physics: MjxPhysics) -> PhysicsView: ...

    @abc.abstractmethod
    def snapshot(self, physics: MjxPhysics) -> Snapshot: ...

    @abc.abstractmethod
    def load(self, physics: MjxPhysics, snapshot: Snapshot, mask: Bool[Array, "W"] | None = None) -> MjxPhysics: ...

    def check(self, physics: MjxPhysics) -> None:
        """Raises StaleStateError where the physics was donated to a program."""
        fresh(physics)

    def current(self, physics: MjxPhysics) -> MjxPhysics:
        """The same."""
        return physics

    def fork(self, physics: MjxPhysics) -> MjxPhysics:
        """See `Engine.fork`: every array is copied, on its device."""
        return copied(fresh(physics))

    def saved(self, physics: MjxPhysics) -> SavedPhysics:
        """See `Engine.saved`."""
        return SavedPhysics(
            snapshot=jax.tree.map(np.array, self.snapshot(fresh(physics))),
            view=jax.tree.map(np.array, self.view(physics)),
            overflow=np.array(physics.overflow),
            wrong_controls=np.array(physics.wrong_controls),
            lost=np.zeros(self.num_worlds, bool),
        )

    def restored(self, saved: SavedPhysics) -> MjxPhysics:
        """See `Engine.restored`. Contacts and all else that is derived are made by the next step."""
        return dataclasses.replace(
            self.load(self.reset(), saved.snapshot),
            link_force=jnp.asarray(saved.view.link_force),
            finger_force=jnp.asarray(saved.view.agent.finger_force),
            overflow=jnp.asarray(saved.overflow),
            wrong_controls=jnp.asarray(saved.wrong_controls),
        )

    def restored_view(self, physics: MjxPhysics, saved: SavedPhysics) -> PhysicsView:
        """See `Engine.restored_view`. A program that computed it would not be the step's, and round otherwise."""
        return jax.tree.map(jnp.asarray, saved.view)

    def frame(self, physics: MjxPhysics, worlds: Sequence[int]) -> tuple[list[list[np.ndarray]], list[np.ndarray]]:
        """See `Engine.frame`."""
        return [], [np.array(leaf) for leaf in jax.tree.leaves(self.snapshot(physics))]
