"""`mixed_pool`: many start states from some, for training: every object lies where it does in one row of a pool, turned
as it is in another.

A policy trained on a few thousand start states with images memorises them. Sampling more takes minutes of all
processors, a mixture a second, and a row of it holds only where the task's objects are. What an object does not show is
what it rests on: mixed are tasks whose objects all lie on one level thing, where nothing but their places differs.

Axes: N rows of the mixture, P of the pool, K task objects.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.scene import Scene
from ig2mj.tasks.task import Task
from ig2mj.worlds.pool import Pool

SEPARATION = 0.005
"""m: objects whose boxes are nearer to each other than this are not put there."""

MOST_TRIES = 50
"""Mixtures are drawn so many times as many as are requested at most."""


@struct.dataclass
class MixedPool(Pool):
    """A pool whose rows are its first row, again and again, but for some coordinates.

    Attributes:
      coordinates: of each row, in the place of `columns` of the scene's qpos.
    """

    coordinates: Float[Array, "N c"] = struct.field(default=None)  # pyright: ignore[reportAssignmentType]
    columns: tuple[int, ...] = struct.field(pytree_node=False, default=())

    @property
    def size(self) -> int:
        return self.coordinates.shape[0]

    def rows(self, index: Int[Array, "W"]) -> Pool:
        """See `Pool.rows`."""
        numpy = np if isinstance(index, np.ndarray) else jnp
        whole = Pool(self.physics, self.states, self.digest).rows(numpy.zeros_like(index))
        qpos, own, columns = whole.physics.scene.qpos, numpy.asarray(self.coordinates)[index], list(self.columns)
        if isinstance(index, np.ndarray):
            qpos = np.array(qpos)
            qpos[:, columns] = own
        else:
            qpos = jnp.asarray(qpos).at[:, np.array(columns)].set(own)
        scene = dataclasses.replace(whole.physics.scene, qpos=qpos)
        return dataclasses.replace(whole, physics=dataclasses.replace(whole.physics, scene=scene))


def mixed_pool(task: Task, scene: Scene, pool: Pool, count: int, seed: int = 0) -> MixedPool:
    """Start states: the pool's own, then mixtures of them.

    Args:
      scene: what the pool is of, with whatever robots. count: N.

    Raises:
      EngineError: the task's start is more than objects that lie on one thing; or the objects leave each other no room.
    """
    said = [condition.strip("()").split() for condition in task.start]
    names = [words[1] for words in said]
    if not said or any(len(words) != 3 or words[0] != "on_top" or words[2] != said[0][2] for words in said):
        raise EngineError(
            f"{task.name}: its start states cannot be augmented: its objects do not all lie on the same surface"
        )
    addresses = [_free_address(scene, name) for name in names]
    columns = tuple(a + k for a in addresses for k in range(7))
    qpos, rng = np.asarray(pool.physics.scene.qpos, np.float64), np.random.default_rng(seed)
    poses = qpos[:, list(columns)].reshape(len(qpos), len(names), 7)
    boxes = [
        (0.5 * t.object_bbox[k], t.object_bbox_center[k])
        for t in (scene.tables,)
        for k in map(scene.object_index, names)
    ]
    inside = [scene.model.body_ipos[scene.tables.object_root[scene.object_index(name)]] for name in names]
    turns = np.stack([matrices_on_host(poses[:, k, 3:]) for k in range(len(names))], axis=1)
    # Where masses have their middle they rest on something, so that is what stays in place; from the base, world axes.
    masses, middles = (
        np.stack([turns[:, k] @ points[k] for k in range(len(names))], axis=1)
        for points in (inside, [center for _, center in boxes])
    )
    found, made = [poses[:count]], min(len(poses), count)
    for _ in range(MOST_TRIES):
        at, turned = rng.integers(0, len(qpos), (2, count, len(names)))
        which = np.arange(len(names))
        drawn = poses[turned, which]
        drawn[..., :2] = poses[at, which][..., :2] + (masses[at, which] - masses[turned, which])[..., :2]
        middle = drawn[..., :3] + middles[turned, which]
        good = _in_reach(task, names, drawn[..., :3] + masses[turned, which])
        for a in range(len(names)):
            for b in range(a):
                good &= ~_meet(
                    (middle[:, a], turns[turned[:, a], a], boxes[a][0]),
                    (middle[:, b], turns[turned[:, b], b], boxes[b][0]),
                )
        found.append(drawn[good])
        made += int(good.sum())
        if made >= count:
            coordinates = np.concatenate(found)[:count].reshape(count, -1)
            first = pool.rows(np.zeros(1, int))
            return MixedPool(first.physics, first.states, pool.digest, coordinates=coordinates, columns=columns)
    raise EngineError(f"{task.name}: {MOST_TRIES * count} tries gave only {made} of {count} augmented start states")


def _free_address(scene: Scene, name: str) -> int:
    """Of an object's free joint in qpos."""
    body = scene.tables.object_root[scene.object_index(name)]
    return int(scene.model.jnt_qposadr[scene.model.body_jntadr[body]])


def _in_reach(task: Task, names: list[str], mass: Float[np.ndarray, "N K 3"]) -> Bool[np.ndarray, "N"]:
    """Rows in which every object's centre of mass is where the task wants it."""
    good = np.ones(len(mass), bool)
    for near in task.near:
        distance = np.linalg.norm(mass[:, names.index(near.object)] - np.asarray(near.pos), axis=-1)
        good &= (near.least <= distance) & (distance <= near.most)
    return good


Box = tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3 3"], Float[np.ndarray, "3"]]
"""Middle, rotation matrix, half sizes."""


def _meet(one: Box, other: Box) -> Bool[np.ndarray, "N"]:
    """Whether two boxes are nearer than `SEPARATION`, seen from above.

    Two convex outlines are apart where one of their sides has the other wholly beyond it; of boxes any edge may be a
    side.
    """
    offset, apart = (other[0] - one[0])[:, :2], np.zeros(len(one[0]), bool)
    for matrix in (one[1], other[1]):
        for edge in range(3):
            side = np.stack([-matrix[:, 1, edge], matrix[:, 0, edge]], axis=-1)
            size = np.linalg.norm(side, axis=-1)
            reach = sum(
                np.abs(np.einsum("nk,nkj->nj", side, box_matrix[:, :2]) * half).sum(-1)
                for _, box_matrix, half in (one, other)
            )
            gap = np.abs((offset * side).sum(-1)) - reach
            apart |= (size > 1e-3) & (gap > SEPARATION * size)
    return ~apart
