"""`SceneView`: what tasks and experts read of all worlds by name: poses, boxes, what is held and touched.

Axes: W worlds, H hands of the scene.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import LinkKind
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.points import Located, Point, locator


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SceneView:
    """All worlds of a scene in one state; positions in the world frame, m. Every method is pure.

    Attributes:
      view, states: of the worlds. scene: the household with its robots. model: constants of the states.
      hands: numbers of the acting hands among all hands of the scene.
    """

    view: PhysicsView
    states: ExtendedStates
    scene: Scene
    model: StateModel
    hands: tuple[int, ...] = ()

    def hand_pos(self, hand: int = 0) -> Float[Array, "W 3"]:
        """Palm or end effector; `hand` counts the acting hands."""
        return jnp.asarray(self.view.agent.hand_pos)[:, self.hands[hand]]

    def hand_quat(self, hand: int = 0) -> Float[Array, "W 4"]:
        """Its orientation."""
        return jnp.asarray(self.view.agent.hand_quat)[:, self.hands[hand]]

    def holds(self, name: str, hand: int = 0) -> Bool[Array, "W"]:
        """Whether an acting hand holds an object."""
        return jnp.asarray(self.view.held)[:, self.hands[hand], self.scene.object_index(name)]

    def touches(self, name: str) -> Bool[Array, "W"]:
        """Whether any part of the robot touches an object."""
        return jnp.asarray(self.view.agent.touching)[:, 0, self.scene.object_index(name)]

    def base_quat(self) -> Float[Array, "W 4"]:
        """Orientation of the robot's base."""
        return jnp.asarray(self.view.agent.base_quat)[:, 0]

    def base_pos(self) -> Float[Array, "W 3"]:
        """Where the robot's base is."""
        return jnp.asarray(self.view.agent.base_pos)[:, 0]

    def link(self, name: str, kind: LinkKind) -> Float[Array, "W 3"]:
        """Where an object's first annotated link of a kind is."""
        tables = self.model.tables
        found = np.flatnonzero((tables.link_object == self.scene.object_index(name)) & (tables.link_kind == kind))
        return jnp.asarray(self.view.link_pos)[:, int(found[0])]

    def pos(self, name: str) -> Float[Array, "W 3"]:
        """Origin of an object's frame."""
        return jnp.asarray(self.view.object_pos)[:, self.scene.object_index(name)]

    def com(self, name: str) -> Float[Array, "W 3"]:
        """An object's centre of mass."""
        return jnp.asarray(self.view.object_com)[:, self.scene.object_index(name)]

    def quat(self, name: str) -> Float[Array, "W 4"]:
        """An object's orientation."""
        return jnp.asarray(self.view.object_quat)[:, self.scene.object_index(name)]

    def box(self, name: str) -> tuple[Float[Array, "W 3"], Float[Array, "W 3"]]:
        """An object's lowest and highest corner, of the size that it has as it lies."""
        index = self.scene.object_index(name)
        return jnp.asarray(self.view.aabb_low)[:, index], jnp.asarray(self.view.aabb_high)[:, index]

    def point(self, point: Point) -> Located:
        """A point of a task, and whether it exists."""
        return locator(point, self.scene, self.model)(self.view, self.states)
