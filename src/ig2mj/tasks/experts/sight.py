"""What a scripted expert reads of a scene: poses of hands and objects by name, and which objects are held.

Axes: W worlds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.agents.task_robot import HandControl
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_multiply, quat_rotate
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import LinkKind
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.points import Located, Point, locator


@struct.dataclass
class Belief:
    """Error of an estimated object pose.

    Attributes:
      move: from the object's origin to its estimated position, m. turn: rotation from its orientation to the estimated
        one.
    """

    move: Float[Array, "W 3"]
    turn: Float[Array, "W 4"]


@dataclasses.dataclass(frozen=True, eq=False)
class ExpertView:
    """All worlds of a scene in their present or an estimated state; positions in the world frame, m.

    Attributes:
      controls: of the acting hands. objects: names of what the task is about, the first object first.
      hands: numbers of the acting hands among all hands of the scene.
      grips: [H, 3] grasp point of every hand in the hand's frame. grasping: the mode.
      beliefs: estimates of objects by name, world frame; other objects are read exactly.
    """

    view: PhysicsView
    states: ExtendedStates
    scene: Scene
    model: StateModel
    controls: tuple[HandControl, ...]
    objects: tuple[str, ...]
    hands: tuple[int, ...]
    grips: Float[np.ndarray, "H 3"]
    grasping: str = "mitten"
    beliefs: Mapping[str, Belief] = dataclasses.field(default_factory=dict)

    @property
    def physical(self) -> bool:
        """Nothing holds but friction."""
        return self.grasping == "physical"

    @property
    def on_arm(self) -> bool:
        """An arm carries the first acting hand."""
        return self.controls[0].on_arm

    @property
    def two_fingers(self) -> bool:
        """The first acting hand has two parallel fingers."""
        return self.controls[0].two_fingers

    def hand_pos(self, hand: int = 0) -> Float[Array, "W 3"]:
        """Palm or end effector; `hand` counts the acting hands."""
        return jnp.asarray(self.view.agent.hand_pos)[:, self.hands[hand]]

    def hand_quat(self, hand: int = 0) -> Float[Array, "W 4"]:
        """Its orientation."""
        return jnp.asarray(self.view.agent.hand_quat)[:, self.hands[hand]]

    def grip(self, hand: int = 0) -> Float[Array, "W 3"]:
        """The point of the hand with which it takes hold: the middle of the palm, or between two fingers."""
        return self.hand_pos(hand) + quat_rotate(self.hand_quat(hand), jnp.asarray(self.grips[self.hands[hand]]))

    def holds(self, name: str, hand: int = 0) -> Bool[Array, "W"]:
        """Whether an acting hand holds an object."""
        return jnp.asarray(self.view.held)[:, self.hands[hand], self.scene.object_index(name)]

    def pressed(self, name: str) -> Float[Array, "W"]:
        """N with which all fingers press on an object."""
        tables = self.scene.tables
        bodies = np.flatnonzero(tables.graspable_object == self.scene.object_index(name))
        return jnp.asarray(self.view.agent.finger_force)[:, :, bodies].sum((1, 2))

    def closed(self, hand: int = 0) -> Float[Array, "W"]:
        """How far the fingers of an acting hand are closed, 0 to 1; the mean of all finger joints."""
        tables, model = self.scene.tables, self.scene.model
        bodies = tables.finger_body[tables.finger_hand == self.hands[hand]]
        joints = np.array([model.body_jntadr[body] for body in bodies])
        places = [int(np.flatnonzero(tables.agent_joint_qposadr == model.jnt_qposadr[joint])[0]) for joint in joints]
        low, high = model.jnt_range[joints].T
        share = (jnp.asarray(self.view.agent.joint_pos)[:, np.array(places)] - low) / (high - low)
        return 1.0 - share.mean(1) if self.controls[hand].opens_high else share.mean(1)

    def squeeze(self, name: str, hand: int = 0) -> Float[Array, "W"]:
        """N with which the second strongest finger link of an acting hand presses on an object."""
        tables = self.scene.tables
        bodies = np.flatnonzero(tables.graspable_object == self.scene.object_index(name))
        fingers = np.flatnonzero(tables.finger_hand == self.hands[hand])
        force = jnp.asarray(self.view.agent.finger_force)[:, fingers][:, :, bodies].max(2)
        return jnp.sort(force, axis=1)[:, -2]

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
        return self._believed(name, jnp.asarray(self.view.link_pos)[:, int(found[0])])

    def pos(self, name: str) -> Float[Array, "W 3"]:
        """Origin of an object's frame."""
        return self._believed(name, jnp.asarray(self.view.object_pos)[:, self.scene.object_index(name)])

    def com(self, name: str) -> Float[Array, "W 3"]:
        """An object's centre of mass."""
        return self._believed(name, jnp.asarray(self.view.object_com)[:, self.scene.object_index(name)])

    def quat(self, name: str) -> Float[Array, "W 4"]:
        """An object's orientation."""
        quat = jnp.asarray(self.view.object_quat)[:, self.scene.object_index(name)]
        return quat_multiply(self.beliefs[name].turn, quat) if name in self.beliefs else quat

    def box(self, name: str) -> tuple[Float[Array, "W 3"], Float[Array, "W 3"]]:
        """An object's lowest and highest corner, of the size that it has as it lies."""
        index = self.scene.object_index(name)
        move = self.beliefs[name].move if name in self.beliefs else 0.0
        return jnp.asarray(self.view.aabb_low)[:, index] + move, jnp.asarray(self.view.aabb_high)[:, index] + move

    def _believed(self, name: str, place: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
        """Where a point of an object is believed to be that is at `place`."""
        if name not in self.beliefs:
            return place
        belief, origin = self.beliefs[name], jnp.asarray(self.view.object_pos)[:, self.scene.object_index(name)]
        return origin + belief.move + quat_rotate(belief.turn, place - origin)

    def point(self, point: Point) -> Located:
        """A point of a task, and whether it exists."""
        return locator(point, self.scene, self.model)(self.view, self.states)

    def goal(self, point: Point, above: float = 0.0) -> jax.Array:
        """A point that always exists, [W, 3], `above` metres higher."""
        return jnp.asarray(self.point(point)[0]).at[:, 2].add(above)
