"""What is in a hand: rays between palm and fingers against the collision pieces of what the fingers touch.

A ray costs a pass over the half-spaces of a piece. So rays are only tested against the `NEAREST` pieces of the `FEW`
nearest bodies that a finger touches, for every hand of every world at once.

Axes: W worlds, H hands, Y graspable bodies, F finger links, N candidates of a hand, P pieces of the largest body.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.agents.hand_rays import HandRays
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import length, quat_rotate, quat_rotate_inverse
from ig2mj.geometry.rays import piece_interval
from ig2mj.scene.tables import SceneTables

FEW, NEAREST = 2, 8
"""Bodies of a hand, and pieces of each, that rays are tested against."""


class Candidates:
    """Finds what each hand could take hold of. Pure; made once for a scene."""

    def __init__(self, tables: SceneTables, hands: list[HandRays], body_ids: dict[str, int]):
        """
        Args:
          hands: of all agents, in the order of the H axis. body_ids: of the bodies that they name.
        """
        self._tables = tables
        self._palm = np.array([body_ids[h.palm] for h in hands], int)
        self._grasp_point = np.stack([h.grasp_point for h in hands]).astype(np.float32)
        self._starts = [(np.array([body_ids[b] for b in h.start_bodies]), h.starts.astype(np.float32)) for h in hands]
        self._ends = [(np.array([body_ids[b] for b in h.end_bodies]), h.ends.astype(np.float32)) for h in hands]
        self._finger_of_hand = tables.finger_hand[None, :] == np.arange(len(hands))[:, None]  # [H, F]
        own = [np.flatnonzero(tables.piece_body == body) for body in tables.graspable_body]
        most = max([1, *map(len, own)])
        self._pieces = np.array([[*p, *[-1] * (most - len(p))] for p in own], int).reshape(-1, most)
        vertices = tables.piece_vertices
        middle = vertices.mean(1) if vertices.size else np.zeros((len(tables.piece_body), 3))
        self._middle = np.asarray(
            tables.piece_pos + np.asarray(quat_rotate(tables.piece_quat, middle)), np.float32
        )  # in the body's frame

    def touched(self, view: PhysicsView) -> Bool[Array, "W H Y"]:
        """A finger link of the hand presses on the body."""
        force = jnp.asarray(view.agent.finger_force)
        return (jnp.asarray(self._finger_of_hand)[None, :, :, None] & (force > 0)[:, None]).any(2)

    def grasp_points(self, view: PhysicsView) -> Float[Array, "W H 3"]:
        """World frame, m."""
        pos, quat = jnp.asarray(view.body_pos)[:, self._palm], jnp.asarray(view.body_quat)[:, self._palm]
        return pos + quat_rotate(quat, jnp.asarray(self._grasp_point))

    def centres(self, view: PhysicsView) -> Float[Array, "W Y 3"]:
        """Centres of mass of movable objects, middles of the pieces of openable links; world frame, m."""
        tables = self._tables
        com = jnp.asarray(view.object_com)[:, tables.graspable_object]
        body = tables.graspable_body
        there = self._pieces >= 0
        own = (self._middle[self._pieces] * there[..., None]).sum(1) / np.maximum(there.sum(1), 1)[:, None]
        link = jnp.asarray(view.body_pos)[:, body] + quat_rotate(jnp.asarray(view.body_quat)[:, body], own)
        return jnp.where((tables.graspable_joint >= 0)[None, :, None], link, com)

    def nearest(
        self, view: PhysicsView, allowed: Bool[Array, "W H Y"], rays: bool
    ) -> tuple[Int[Array, "W H"], Bool[Array, "W H"]]:
        """The allowed body nearest to the grasp point, and whether there is one; with `rays`, of those in the hand."""
        offset = self.grasp_points(view)[:, :, None] - self.centres(view)[:, None]
        distance = jnp.where(allowed, length(offset), jnp.inf)
        few = min(FEW, distance.shape[-1])
        near, body = jax.lax.top_k(-distance, few)  # [W, H, N]
        good = near > -jnp.inf
        if rays:
            good &= self._between(view, body)
        first = jnp.argmax(good, axis=-1)[..., None]
        chosen = jnp.take_along_axis(body, first, axis=-1)[..., 0]
        return chosen.astype(jnp.int32), good.any(-1)

    def _between(self, view: PhysicsView, body: Int[Array, "W H N"]) -> Bool[Array, "W H N"]:
        """A ray of the hand meets the body. (A ray that begins in it counts, too: what is pressed to the palm is.)"""
        pos, quat = jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)
        hits = []
        for hand, ((start_body, start), (end_body, end)) in enumerate(zip(self._starts, self._ends, strict=True)):
            begin = pos[:, start_body] + quat_rotate(quat[:, start_body], start)  # [W, S, 3]
            finish = pos[:, end_body] + quat_rotate(quat[:, end_body], end)
            origin = jnp.repeat(begin, finish.shape[1], axis=1)  # [W, R, 3]
            along = jnp.tile(finish, (1, begin.shape[1], 1)) - origin
            hits.append(self._meets(view, origin, along, body[:, hand]))
        return jnp.stack(hits, axis=1)

    def _meets(
        self,
        view: PhysicsView,
        origin: Float[Array, "W R 3"],
        along: Float[Array, "W R 3"],
        body: Int[Array, "W N"],
    ) -> Bool[Array, "W N"]:
        tables = self._tables
        ids = jnp.asarray(tables.graspable_body)[body]
        take = jax.vmap(lambda rows, index: rows[index])
        pos, quat = take(jnp.asarray(view.body_pos), ids), take(jnp.asarray(view.body_quat), ids)  # [W, N, .]
        # Rays in the frames of the bodies: [W, N, R, 3].
        origin = quat_rotate_inverse(quat[:, :, None], origin[:, None] - pos[:, :, None])
        along = quat_rotate_inverse(quat[:, :, None], jnp.broadcast_to(along[:, None], origin.shape))
        pieces = jnp.asarray(self._pieces)[body]  # [W, N, P]
        middle = (origin + 0.5 * along).mean(2)
        apart = length(jnp.asarray(self._middle)[pieces] - middle[:, :, None])
        count = min(NEAREST, self._pieces.shape[1])
        _, order = jax.lax.top_k(-jnp.where(pieces >= 0, apart, jnp.inf), count)
        piece = jnp.take_along_axis(pieces, order, axis=-1)  # [W, N, M]
        frame = jnp.asarray(tables.piece_quat, jnp.float32)[piece][:, :, :, None]
        place = jnp.asarray(tables.piece_pos, jnp.float32)[piece][:, :, :, None]
        low, high = piece_interval(
            jnp.asarray(tables.piece_kind)[piece][..., None],
            jnp.asarray(tables.piece_size, jnp.float32)[piece][:, :, :, None],
            jnp.asarray(tables.piece_planes, jnp.float32)[piece][:, :, :, None],
            quat_rotate_inverse(frame, origin[:, :, None] - place),
            quat_rotate_inverse(frame, jnp.broadcast_to(along[:, :, None], (*piece.shape, *along.shape[2:]))),
        )
        meets = (low <= high) & (low <= 1.0) & (high >= 0.0)
        return (meets & (piece >= 0)[..., None]).any((-2, -1))
