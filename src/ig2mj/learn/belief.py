"""What an actor believes of where objects are, for experts that answer as if it were so.

An actor that remembers (`ig2mj.learn.recall`) is wrong by about a centimetre for a whole episode. An expert that sees
the truth asks it to go on from where it takes itself to be right, now here, now there, and what it learns is the mean:
to stay. Told what the actor believes, the expert answers with what can be learnt; where an object lies elsewhere by now
than an actor can know, with the truth.

Axes: W worlds, K objects, C ways to believe, others as in `ig2mj.learn.recall`.
"""

from __future__ import annotations

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length, matrix_to_quat, quat_conjugate, quat_multiply, quat_to_rotation_vector
from ig2mj.learn.hidden import Hidden
from ig2mj.learn.recall import POSE, Recall
from ig2mj.tasks.experts.sight import Belief

NEAR = 0.05
"""m: who is farther off does not know where an object is."""

SAME = 0.01
"""m by which what is remembered may be off by more or less than it was at first: else the object has moved since. An
expert that is not told so finds a fruit cut that has rolled away, and wants nothing more. By more than that what is
seen now must be nearer to the truth."""

TURNED = 0.6
"""rad: nor how it lies."""

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0], np.float32)


def nothing(hidden: Hidden, worlds: int) -> dict[str, Belief]:
    """Objects are believed to be where they are."""
    return {n: Belief(jnp.zeros((worlds, 3)), jnp.tile(UPRIGHT, (worlds, 1))) for n in hidden.poses}


def true_at(where: Bool[Array, "W"], beliefs: Mapping[str, Belief]) -> dict[str, Belief]:
    """The same, but right in some worlds."""
    right = jnp.asarray(where)[:, None]
    return {n: Belief(jnp.where(right, 0.0, b.move), jnp.where(right, UPRIGHT, b.turn)) for n, b in beliefs.items()}


def errors_of(
    recall: Recall, scales: tuple[Float[Array, "v"], Float[Array, "v"]], vector: Float[Array, "W v"], guess: Array
) -> Float[Array, "W K"]:
    """How far off a guess [W, g] is from where each object is, m. Other arguments as of `beliefs_of`."""
    now = guess[:, np.array(recall.poses, int)].reshape(len(vector), -1, POSE)
    return length(_moves(recall, scales, vector, now[:, None]))[:, 0]


def _moves(
    recall: Recall,
    scales: tuple[Float[Array, "v"], Float[Array, "v"]],
    vector: Float[Array, "W v"],
    poses: Float[Array, "W C K p"],
) -> Float[Array, "W C K 3"]:
    """From where objects are to where they are believed to be."""
    places = np.array(recall.places, int)
    middle, spread = (jnp.asarray(scale)[places] for scale in scales)
    return poses[..., :3] * spread + middle - vector[:, None, places]


def beliefs_of(
    recall: Recall,
    hidden: Hidden,
    scales: tuple[Float[Array, "v"], Float[Array, "v"]],
    vector: Float[Array, "W v"],
    kept: Float[Array, "W m"],
    guess: Float[Array, "W g"],
    at_first: Float[Array, "W K"],
) -> dict[str, Belief]:
    """How wrong an actor is about each object that it guesses, in the frame of the robot's base.

    It takes an object to be where it lay at first or, if a hand took it, where that brings it, whichever is nearer to
    the truth; if it has moved from where it lay at first, to be where it sees it now, should that be nearer. What a
    hand holds it sees worse than it remembers it: an expert that now and then answered for what is seen of that would
    be followed by nobody, who cannot know when.

    Args:
      scales: mean and deviation of the vector. vector: as it was observed. kept: what is remembered now. at_first: by
        how much it was off in the episode's first step (`errors_of`).
    """
    mean, deviation = scales
    worlds, names = len(vector), list(hidden.poses)
    first = kept[:, : len(recall.poses)].reshape(worlds, 1, -1, POSE)
    now = guess[:, np.array(recall.poses, int)].reshape(worlds, 1, -1, POSE)
    ways = [first, now]
    if recall.hands:
        ways.insert(1, recall.carried(kept, vector, mean, deviation).reshape(worlds, -1, len(names), POSE))
    believed = jnp.concatenate(ways, axis=1)  # [W, C, K, POSE], what is seen now last
    moves = _moves(recall, scales, vector, believed)
    errors = length(moves)
    remembered = errors[:, :-1].argmin(axis=1)
    least = jnp.min(errors[:, :-1], axis=1)
    moved, nearer = jnp.abs(least - at_first) > SAME, least - errors[:, -1] > SAME
    sees = moved & nearer & (remembered == 0)  # without a hand that holds something all ways but the last are one
    which = jnp.where(sees, believed.shape[1] - 1, remembered)[:, None, :, None]
    move = jnp.take_along_axis(moves, which, axis=1)[:, 0]
    turned = _quats(jnp.take_along_axis(believed[..., 3:], which, axis=1)[:, 0])
    turn = quat_multiply(turned, quat_conjugate(vector[:, hidden.quats]))
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
