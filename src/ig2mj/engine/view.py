"""`PhysicsView`: what states, predicates, sensors and tasks know of physics. Every engine can produce it.

It is the narrow waist between engines and everything above them. All arrays begin with the world axis.

Axes: W worlds, O objects (order of the manifest), B bodies of the MuJoCo model (0 is the world), L annotated links
(order of `SceneTables.link_*`), J openable joints (order of `SceneTables.openable_*`), A agents (0 or 1),
F finger links of all agents.
"""

from __future__ import annotations

import jax
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

Array = jax.Array | np.ndarray
"""The native engine gives numpy arrays, the MJX engines JAX's; jitted functions take both."""


@struct.dataclass
class PhysicsView:
    """A snapshot of physics at the end of a control step, world frame, metres, w-x-y-z quaternions, float32.

    Attributes:
      object_pos, object_quat: frame of each object's main body.
      object_com: centre of mass of each object's main body. iGibson's "position" of an object (spec/states.md 4.1).
      aabb_low, aabb_high: world box over all bodies of the object; the tight one or iGibson's rotated-local-box rule,
        as the engine was told.
      body_pos, body_quat: every body's frame; collision pieces are posed with it.
      link_pos, link_quat: annotated links: the site's, or the geom's, frame.
      joint_pos: openable joints.
      touching: surfaces no further apart than the engine's tolerance (3 mm), symmetric, diagonal false. Remembered
        for pairs that sleep (design section 2, fact 7).
      link_force: the largest normal force, newtons, of any contact and any physics step of this control step, of each
        annotated link's geom against each object; 0 for links that are sites.
      awake: the object has a body that moves or may move now; fixed objects with no joints are never awake.
      agent_pos: the agent's base body. eye_pos, eye_quat: its camera (MuJoCo camera axes: -z forward, y up).
      finger_pos: frames of finger links.
      grasped: the agent holds the object (assistive grasping is active on it).
    """

    object_pos: Float[Array, "W O 3"]
    object_quat: Float[Array, "W O 4"]
    object_com: Float[Array, "W O 3"]
    aabb_low: Float[Array, "W O 3"]
    aabb_high: Float[Array, "W O 3"]
    body_pos: Float[Array, "W B 3"]
    body_quat: Float[Array, "W B 4"]
    link_pos: Float[Array, "W L 3"]
    link_quat: Float[Array, "W L 4"]
    joint_pos: Float[Array, "W J"]
    touching: Bool[Array, "W O O"]
    link_force: Float[Array, "W L O"]
    awake: Bool[Array, "W O"]
    agent_pos: Float[Array, "W A 3"]
    eye_pos: Float[Array, "W A 3"]
    eye_quat: Float[Array, "W A 4"]
    finger_pos: Float[Array, "W F 3"]
    grasped: Bool[Array, "W A O"]
