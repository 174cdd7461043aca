"""Labels for where the actor believes objects to be (`BeliefAdviser`).

An actor with an object memory (`ig2mj.learn.occlusion.object_memory`) is off by about a centimetre for a whole episode.
An expert that sees the truth corrects it in random directions; the actor cannot know these, so it learns the average
action, which is not to move. An expert that is given the actor's belief answers with what can be learned. Where an
object has moved farther than the actor can know, the expert answers for the truth.

Axes: W worlds, K objects, C candidates for a belief, others as in `ig2mj.learn.occlusion.object_memory`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length, matrix_to_quat, quat_conjugate, quat_multiply, quat_to_rotation_vector
from ig2mj.learn.occlusion.object_memory import POSE, ObjectMemory
from ig2mj.learn.privileged_targets import PrivilegedTargets
from ig2mj.learn.protocols import Scales
from ig2mj.tasks.experts.sight import Belief

NEAR = 0.05
"""m: a belief that is farther off counts as no knowledge of where the object is."""

SAME = 0.01
"""m that the error of a memory may differ from its error in the first step; more means that the object has moved since.
What is seen now replaces the memory only if it is nearer to the truth by more than that."""

TURNED = 0.6
"""rad: the same as `NEAR`, for the orientation."""

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0], np.float32)


@struct.dataclass
class BeliefNotes:
    """What the adviser knows of the actor. beliefs: where it takes objects to be. at_first: m by which it was off in
    the episode's first step."""

    beliefs: dict[str, Belief]
    at_first: Float[Array, "W K"]


class BeliefAdviser:
    """A `protocols.Adviser`: an expert that answers as if the actor's beliefs were true."""

    def __init__(self, expert: Callable[..., Array], memory: ObjectMemory, targets: PrivilegedTargets):
        """`expert`: from a state and beliefs of objects by name to actions (`ig2mj.envs.experts.expert_of`)."""
        self._expert, self._memory, self._targets = expert, memory, targets

    def begin(self, num_worlds: int) -> BeliefNotes:
        """Objects are believed to be where they are."""
        return BeliefNotes(no_error(self._targets, num_worlds), jnp.zeros((num_worlds, len(self._targets.poses))))

    def label(self, state: Any, notes: BeliefNotes, begins: Bool[Array, "W"]) -> Float[Array, "W n"]:
        """The expert's actions; in the first step of an episode nothing is believed yet."""
        return self._expert(state, true_at(begins, notes.beliefs))

    def observe(
        self,
        notes: BeliefNotes,
        begins: Bool[Array, "W"],
        scales: Scales,
        vector: Float[Array, "W v"],
        kept: Float[Array, "W m"],
        prediction: Float[Array, "W g"],
    ) -> BeliefNotes:
        """Notes with the actor's beliefs."""
        now = errors_of(self._memory, scales, vector, prediction)
        at_first = jnp.where(begins[:, None], now, notes.at_first)
        beliefs = beliefs_of(self._memory, self._targets, scales, vector, kept, prediction, at_first)
        return BeliefNotes(beliefs, at_first)


def no_error(targets: PrivilegedTargets, worlds: int) -> dict[str, Belief]:
    """Beliefs that are true."""
    return {n: Belief(jnp.zeros((worlds, 3)), jnp.tile(UPRIGHT, (worlds, 1))) for n in targets.poses}


def true_at(where: Bool[Array, "W"], beliefs: Mapping[str, Belief]) -> dict[str, Belief]:
    """The same beliefs, but true in some worlds."""
    right = jnp.asarray(where)[:, None]
    return {n: Belief(jnp.where(right, 0.0, b.move), jnp.where(right, UPRIGHT, b.turn)) for n, b in beliefs.items()}


def errors_of(
    memory: ObjectMemory,
    scales: Scales,
    vector: Float[Array, "W v"],
    prediction: Array,
) -> Float[Array, "W K"]:
    """Distance of each object's predicted position from the true one, m. Arguments as of `beliefs_of`."""
    now = prediction[:, np.array(memory.poses, int)].reshape(len(vector), -1, POSE)
    return length(_moves(memory, scales, vector, now[:, None]))[:, 0]


def _moves(
    memory: ObjectMemory,
    scales: Scales,
    vector: Float[Array, "W v"],
    poses: Float[Array, "W C K p"],
) -> Float[Array, "W C K 3"]:
    """From the true positions of objects to the believed ones, m."""
    places = np.array(memory.places, int)
    middle, spread = (jnp.asarray(scale)[places] for scale in scales)
    return poses[..., :3] * spread + middle - vector[:, None, places]


def beliefs_of(
    memory: ObjectMemory,
    targets: PrivilegedTargets,
    scales: Scales,
    vector: Float[Array, "W v"],
    kept: Float[Array, "W m"],
    prediction: Float[Array, "W g"],
    at_first: Float[Array, "W K"],
) -> dict[str, Belief]:
    """The error of an actor's belief about each object, in the frame of the robot's base.

    The actor takes an object to be where it lay at first or where the hand that took it carries it, whichever is nearer
    to the truth. An object that has moved from its first position is where the actor sees it now, if that is nearer.
    For what a hand holds the memory counts even then: the actor cannot know when what it sees of it is better.

    Args:
      scales: mean and deviation of the vector. vector: as it was observed. kept: what is remembered now. at_first: m by
        which it was off in the episode's first step (`errors_of`).
    """
    mean, deviation = scales
    worlds, names = len(vector), list(targets.poses)
    first = kept[:, : len(memory.poses)].reshape(worlds, 1, -1, POSE)
    now = prediction[:, np.array(memory.poses, int)].reshape(worlds, 1, -1, POSE)
    ways = [first, now]
    if memory.hands:
        ways.insert(1, memory.carried(kept, vector, mean, deviation).reshape(worlds, -1, len(names), POSE))
    believed = jnp.concatenate(ways, axis=1)  # [W, C, K, POSE], what is seen now last
    moves = _moves(memory, scales, vector, believed)
    errors = length(moves)
    remembered = errors[:, :-1].argmin(axis=1)
    least = jnp.min(errors[:, :-1], axis=1)
    moved, nearer = jnp.abs(least - at_first) > SAME, least - errors[:, -1] > SAME
    sees = moved & nearer & (remembered == 0)  # without a hand that holds something all ways but the last are one
    which = jnp.where(sees, believed.shape[1] - 1, remembered)[:, None, :, None]
    move = jnp.take_along_axis(moves, which, axis=1)[:, 0]
    turned = _quats(jnp.take_along_axis(believed[..., 3:], which, axis=1)[:, 0])
    turn = quat_multiply(turned, quat_conjugate(vector[:, targets.quats]))
    lost = (length(move) > NEAR)[..., None]
    move = jnp.where(lost, 0.0, move)
    turn = jnp.where(lost | (length(quat_to_rotation_vector(turn)) > TURNED)[..., None], UPRIGHT, turn)
    return {name: Belief(move[:, k], turn[:, k]) for k, name in enumerate(names)}


def _quats(columns: Float[Array, "W K 6"]) -> Float[Array, "W K 4"]:
    """The rotation whose first two columns are nearest to these, the first before the second."""
    x, y = columns[..., :3], columns[..., 3:]
    x /= jnp.maximum(length(x), 1e-6)[..., None]
    y -= x * jnp.sum(x * y, axis=-1, keepdims=True)
    y /= jnp.maximum(length(y), 1e-6)[..., None]
    return matrix_to_quat(jnp.stack([x, y, jnp.cross(x, y)], axis=-1))
