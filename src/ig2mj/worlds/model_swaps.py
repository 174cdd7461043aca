"""`ModelSwaps`: objects that change places with others of their category when an episode begins.

A scene has every model that an object may have, the ones that are not used on a slab outside of the house, where they
sleep and cost next to nothing. Rows of a pool have the object of the task in its place; an episode that draws another
model puts that there, turned in the same way, on the same height and about the same middle, and the first on the slab.

Axes: W worlds, P rows, K choices, R roles, O objects.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.layout import make_layout
from ig2mj.engine.snapshot import FULLY_AWAKE
from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.geometry.poses import matrices_on_host, namespace, quat_to_matrix
from ig2mj.scene.additions import HEIGHT
from ig2mj.scene.scene import Scene
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.randomization import pick

CLEAR = 0.001
"""m above its support at which another model is put down."""

WAITING = HEIGHT + 2.0
"""m: objects whose origin is lower wait on the slab."""

DEEP = 0.004
"""m: a model that reaches deeper into something than this does not fit into a row."""


class ModelSwaps:
    """See the module's text. `draw` and `swapped` may be part of a compiled program.

    Attributes:
      roles: objects that rows of pools have in place. names: [K][R] objects that take their parts with each choice.
    """

    def __init__(self, scene: Scene, roles: Sequence[str], names: Sequence[Sequence[str]]):
        """`roles`: objects that rows of pools have in place."""
        self.scene, self.roles, self.names = scene, tuple(roles), [tuple(one) for one in names]
        tables, layout = scene.tables, make_layout(scene.model, scene.tables)
        self._base = np.array([scene.object_index(name) for name in roles])
        self._other = np.array([[scene.object_index(name) for name in one] for one in names])
        self._address, self._dof = layout.object_qposadr, layout.object_dofadr
        self._trees, self._unit_object = layout.object_trees, layout.unit_object[: layout.num_object_units]
        self._half, self._centre = 0.5 * tables.object_bbox, tables.object_bbox_center
        self._away = np.asarray(scene.start_data().qpos, np.float32)
        self._root = tables.object_root
        whole = np.where(tables.object_part_of >= 0, tables.object_part_of, np.arange(len(tables.object_names)))
        self._parts = (whole == self._other[..., None]).astype(np.float32)  # [K, R, O]

    def draw(self, key: UInt[Array, "W 2"]) -> Int[Array, "W"]:
        """The choice of worlds whose episodes have these keys."""
        return pick(key, "models", len(self.names))

    def fitted(self, choice: Int[Array, "W"], row: Int[Array, "W"], fits: Bool[np.ndarray, "P K"]) -> Int[Array, "W"]:
        """The first choice from the drawn one on that fits into each row; the drawn one where none does."""
        count = len(self.names)
        turns = (choice[:, None] + jnp.arange(count)) % count
        good = jnp.take_along_axis(jnp.asarray(fits)[row], turns, axis=1)
        return jnp.take_along_axis(turns, jnp.argmax(good, axis=1)[:, None], axis=1)[:, 0]

    def swapped(self, rows: Pool, choice: Int[Array, "W"]) -> Pool:
        """Rows in which the objects of the choices are in place."""
        scene, states = rows.physics.scene, rows.states
        qpos, asleep = jnp.asarray(scene.qpos), jnp.asarray(scene.tree_asleep)
        touching = jnp.asarray(scene.touching)
        order = jnp.broadcast_to(jnp.arange(len(self._root)), (qpos.shape[0], len(self._root)))
        for r, base in enumerate(self._base):
            other = jnp.asarray(self._other[:, r])[choice]
            moved = other != base
            at, to = self._columns(int(base)), jnp.asarray(self._address)[other][:, None] + jnp.arange(7)
            pose = qpos[:, at]
            waits = jnp.take_along_axis(qpos, to, axis=1)
            placed = self._placed(pose, jnp.full_like(other, base), other)
            worlds = jnp.arange(qpos.shape[0])[:, None]
            qpos = qpos.at[:, at].set(jnp.where(moved[:, None], waits, pose))
            qpos = qpos.at[worlds, to].set(jnp.where(moved[:, None], placed, jnp.take_along_axis(qpos, to, axis=1)))
            trees = (jnp.asarray(self._trees[base]) | jnp.asarray(self._trees)[other])[:, : asleep.shape[1]]
            asleep = jnp.where(moved[:, None] & trees, FULLY_AWAKE, asleep)
            units = (self._unit_object == base) | (self._unit_object == other[:, None])
            touching &= ~(moved[:, None, None] & (units[:, :, None] | units[:, None, :]))
            numbers = jnp.arange(order.shape[1])
            order = jnp.where(moved[:, None] & (numbers == base), other[:, None], order)
            order = jnp.where(moved[:, None] & (numbers == other[:, None]), base, order)

        def permuted(array: Array) -> Array:
            array = jnp.asarray(array)
            if array.ndim < 2 or array.shape[1] != order.shape[1]:
                return array
            index = order.reshape(*order.shape, *(1,) * (array.ndim - 2))
            return jnp.take_along_axis(array, index, axis=1)

        scene = dataclasses.replace(scene, qpos=qpos, tree_asleep=asleep, touching=touching)
        physics = dataclasses.replace(rows.physics, scene=scene)
        return dataclasses.replace(rows, physics=physics, states=jax.tree.map(permuted, states))

    def models(self, choice: Int[Array, "W"]) -> Int[Array, "W R"]:
        """Objects that have the roles."""
        return namespace(choice).asarray(self._other, np.int32)[choice]

    def lowest(self, floor: Float[np.ndarray, "O"]) -> Float[np.ndarray, "O"]:
        """Heights below which objects have left the house, where those of a role wait in each other's places."""
        floor = np.array(floor)
        for r, base in enumerate(self._base):
            group = np.unique([base, *self._other[:, r]])
            floor[group] = floor[group].min()
        return floor

    def active(self, object_pos: Float[Array, "W O 3"]) -> Int[Array, "W"]:
        """The choice that most objects in the house belong to; halves count as their whole."""
        there = jnp.asarray(object_pos)[..., 2] > WAITING
        return jnp.argmax(jnp.sum(jnp.einsum("wo,kro->wkr", there, self._parts) > 0, axis=-1), axis=1)

    def fits(self, pool: Pool) -> Bool[np.ndarray, "P K"]:
        """Whether the objects of each choice go into each row without reaching into anything. On the host."""
        tables, start = self.scene.tables, np.asarray(pool.physics.scene.qpos)
        swapping = np.isin(tables.geom_object, np.unique([*self._base, *self._other.ravel()]))
        model = only_contacts_of(self.scene.model, swapping)
        data = mujoco.MjData(model)
        found = np.ones((pool.size, len(self.names)), bool)
        for k, objects in enumerate(self._other):
            if (objects == self._base).all():
                continue
            qpos = self._with_others(start, objects)
            for row in range(pool.size):
                data.qpos[:] = self._away
                data.qpos[: qpos.shape[1]] = qpos[row]
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_collision(model, data)
                contact = data.contact
                mine = np.isin(tables.geom_object[contact.geom], objects).any(1) if len(contact.dist) else []
                found[row, k] = not (contact.dist[mine] < -DEEP).any() if len(contact.dist) else True
        return found

    def _with_others(self, qpos: Float[np.ndarray, "P q"], objects: Int[np.ndarray, "R"]) -> Float[np.ndarray, "P q"]:
        """Coordinates of rows with these objects in place, as `swapped` has them. On the host."""
        qpos = qpos.copy()
        for base, other in zip(self._base, objects, strict=True):
            if base == other:
                continue
            at, to = self._columns(int(base)), self._columns(int(other))
            pose, waits = qpos[:, at], qpos[:, to]  # copies
            qpos[:, at], qpos[:, to] = waits, self._placed(pose, np.full(len(qpos), base), np.full(len(qpos), other))
        return qpos

    def _columns(self, number: int) -> np.ndarray:
        return int(self._address[number]) + np.arange(7)

    def _placed(self, pose: Float[Array, "W 7"], base: Int[Array, "W"], other: Int[Array, "W"]) -> Float[Array, "W 7"]:
        """The pose of another object in the place of one."""
        xp = namespace(pose)
        turn = matrices_on_host(pose[:, 3:]) if isinstance(pose, np.ndarray) else quat_to_matrix(pose[:, 3:])

        def low(which: Array) -> Float[Array, "W 3"]:
            middle = xp.einsum("wij,wj->wi", turn, xp.asarray(self._centre, xp.float32)[which])
            half = xp.einsum("wij,wj->wi", xp.abs(turn), xp.asarray(self._half, xp.float32)[which])
            return middle - half * np.array([0.0, 0.0, 1.0], np.float32)

        pos = pose[:, :3] + low(base) - low(other)
        return xp.concatenate([pos + np.array([0, 0, CLEAR], np.float32), pose[:, 3:]], axis=1)


def only_contacts_of(model: mujoco.MjModel, geoms: Bool[np.ndarray, "G"]) -> mujoco.MjModel:
    """A copy of a model in which collision detection finds the contacts of these geoms, and of no two others.

    Each pair of collision masks among the geoms gets a bit of its own, which is the only one of their `contype`; the
    `conaffinity` of a geom has the bits of the masks that it collides with.

    Raises:
      EngineError: the geoms have more than 31 different masks.
    """
    masks = np.stack([model.geom_contype, model.geom_conaffinity], axis=1)
    kinds, kind = np.unique(masks[geoms], axis=0, return_inverse=True)
    if len(kinds) > 31:
        raise EngineError(f"objects whose models differ have {len(kinds)} different collision masks; 31 are possible")
    meets = (masks[:, :1] & kinds[:, 1]) | (masks[:, 1:] & kinds[:, 0])  # [G, masks]
    bits = 1 << np.arange(len(kinds))
    own = copy.copy(model)
    own.geom_contype[:] = 0
    own.geom_contype[geoms] = bits[kind.ravel()]
    own.geom_conaffinity[:] = ((meets != 0) * bits).sum(axis=1)
    for of_body, of_geom in (
        (own.body_contype, own.geom_contype),
        (own.body_conaffinity, own.geom_conaffinity),
    ):
        of_body[:] = 0
        np.bitwise_or.at(of_body, own.geom_bodyid, of_geom)
    return own
