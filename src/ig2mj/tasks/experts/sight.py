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
from jaxtyping import Float

from ig2mj.agents.task_robot import HandControl
from ig2mj.engine.view import Array
from ig2mj.geometry.poses import quat_multiply, quat_rotate
from ig2mj.scene.tables import LinkKind
from ig2mj.tasks.points import Point
from ig2mj.tasks.scene_view import SceneView


@struct.dataclass
class Belief:
    """Error of an estimated object pose.

    Attributes:
      move: from the object's origin to its estimated position, m. turn: rotation from its orientation to the estimated
        one.
    """

    move: Float[Array, "W 3"]
    turn: Float[Array, "W 4"]


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class ExpertView(SceneView):
    """All worlds of a scene in their present or an estimated state; positions in the world frame, m.

    Attributes:
      controls: of the acting hands. objects: names of what the task is about, the first object first.
      grips: [H, 3] grasp point of every hand in the hand's frame. grasping: the mode.
      beliefs: estimates of objects by name, world frame; other objects are read exactly.
    """

    controls: tuple[HandControl, ...]
    objects: tuple[str, ...]
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

    def grip(self, hand: int = 0) -> Float[Array, "W 3"]:
        """The point of the hand with which it takes hold: the middle of the palm, or between two fingers."""
        return self.hand_pos(hand) + quat_rotate(self.hand_quat(hand), jnp.asarray(self.grips[self.hands[hand]]))

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

    def link(self, name: str, kind: LinkKind) -> Float[Array, "W 3"]:
        """Where an object's first annotated link of a kind is."""
        return self._believed(name, super().link(name, kind))

    def pos(self, name: str) -> Float[Array, "W 3"]:
        """Origin of an object's frame."""
        return self._believed(name, super().pos(name))

    def com(self, name: str) -> Float[Array, "W 3"]:
        """An object's centre of mass."""
        return self._believed(name, super().com(name))

    def quat(self, name: str) -> Float[Array, "W 4"]:
        """An object's orientation."""
        quat = super().quat(name)
        return quat_multiply(self.beliefs[name].turn, quat) if name in self.beliefs else quat

    def box(self, name: str) -> tuple[Float[Array, "W 3"], Float[Array, "W 3"]]:
        """An object's lowest and highest corner, of the size that it has as it lies."""
        low, high = super().box(name)
        move = self.beliefs[name].move if name in self.beliefs else 0.0
        return low + move, high + move

    def _believed(self, name: str, place: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
        """Where a point of an object is believed to be that is at `place`."""
        if name not in self.beliefs:
            return place
        belief, origin = self.beliefs[name], jnp.asarray(self.view.object_pos)[:, self.scene.object_index(name)]
        return origin + belief.move + quat_rotate(belief.turn, place - origin)

    def goal(self, point: Point, above: float = 0.0) -> jax.Array:
        """A point that always exists, [W, 3], `above` metres higher."""
        return jnp.asarray(self.point(point)[0]).at[:, 2].add(above)
