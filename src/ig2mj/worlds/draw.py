"""`Draw`: what was drawn for each world's episode besides fields of MuJoCo's model, as a pytree.

Physics, materials and lights of an episode are fields of the world's model (`ig2mj.engine.model_fields`), and poses are
coordinates; snapshots have both. All else that `Randomize` draws is here. A batch keeps it, so that files of states and
recordings have it, too.

Axes: W worlds, R roles (objects of a task whose models vary), N lights: that at the camera, the home's own, and
`SPARE_LIGHTS` more.
"""

from __future__ import annotations

from flax import struct
from jaxtyping import Float, Int

from ig2mj.engine.view import Array

SPARE_LIGHTS = 2
"""Lights that are off but for worlds whose number of lights differs."""


@struct.dataclass
class Draw:
    """Of every world; None: the axis is off.

    Attributes:
      models: which object has each part that varies, numbers in the scene.
      object_poses: row of the start states that `tasks.object_poses` made.
      robot_start: x and y (m) and yaw (rad) by which the robot starts elsewhere, in the frame of its usual start.
      camera_pos, camera_quat: by which the robot's cameras are displaced, m and w-x-y-z, in each camera's own frame
        (x right, y up, -z forward).
      camera_slope: factor of the tangent of half the vertical field of view.
      light_colour: factors of each light's red, green and blue; 0: it is off. light_quat: by which it is turned.
      noise: 0..1, strength of the noise of the episode's observations.
      instruction: number of the wording; takes the remainder by the number of wordings.
    """

    models: Int[Array, "W R"] | None = None
    object_poses: Int[Array, "W"] | None = None
    robot_start: Float[Array, "W 3"] | None = None
    camera_pos: Float[Array, "W 3"] | None = None
    camera_quat: Float[Array, "W 4"] | None = None
    camera_slope: Float[Array, "W"] | None = None
    light_colour: Float[Array, "W N 3"] | None = None
    light_quat: Float[Array, "W N 4"] | None = None
    noise: Float[Array, "W"] | None = None
    instruction: Int[Array, "W"] | None = None
