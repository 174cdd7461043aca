"""Attached(a, b): a is held to b by a weld (OmniGibson's attached_to.py; assembled and hung are the same).

An object that comes to touch the other one of its pair is attached as it is; of a pair with a place, where its box is
within `NEAR` of the place. It comes off where it is pulled `APART`
from its place, which takes about 250 N for each kilogram (`ig2mj.scene.extras.IMPEDANCE`), and can be attached again
after the two have been apart. It is attached to one object at a time.

The states say what is attached; the core switches the constraints (`ig2mj.worlds.joints`).

Axes: W worlds, N pairs of a scene, O objects.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import length, quat_rotate, relative_pose
from ig2mj.scene.extras import ATTACHED, pairs_of
from ig2mj.scene.manifest import Manifest
from ig2mj.scene.tables import SceneTables
from ig2mj.states.spec import EventStep, Saved, StateSpec, nothing_inherited

if TYPE_CHECKING:
    from ig2mj.states.model import StateModel
    from ig2mj.states.world import ExtendedStates

APART = 0.01
"""m between the two ends of a joint at which it gives way."""

NEAR = 0.02
"""m between the box of an object and its place from which it is attached there."""


@dataclasses.dataclass(frozen=True, eq=False)
class Joints:
    """Pairs that can be attached: objects, and their main bodies.

    Attributes:
      place: where each is attached, m, frame of the parent's main body; NaN: anywhere.
    """

    child: Int[np.ndarray, "N"]
    parent: Int[np.ndarray, "N"]
    child_body: Int[np.ndarray, "N"]
    parent_body: Int[np.ndarray, "N"]
    place: Float[np.ndarray, "N 3"]

    @classmethod
    def of_manifest(cls, tables: SceneTables, manifest: Manifest) -> Joints:
        """Those of a scene."""
        pairs = pairs_of(manifest.extras)
        child = np.array([tables.object_names.index(p.child) for p in pairs], int)
        parent = np.array([tables.object_names.index(p.parent) for p in pairs], int)
        place = np.array([p.place or (np.nan,) * 3 for p in pairs], np.float32).reshape(-1, 3)
        return cls(child, parent, tables.object_root[child], tables.object_root[parent], place)

    def number_of(self, child: int, parent: int) -> int | None:
        """The place of a pair of objects on the N axis; None: it is none."""
        found = np.flatnonzero((self.child == child) & (self.parent == parent))
        return int(found[0]) if len(found) else None


def of(model: StateModel) -> Joints:
    """The pairs of a scene that has some."""
    assert model.joints is not None
    return model.joints


def parameters(joints: Joints, view: PhysicsView) -> Float[Array, "W N 10"]:
    """MuJoCo's eq_data, without torque scale, of joints at the present poses; their anchors are the children's."""
    pos, quat = jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)
    at = jnp.asarray(view.object_com)[:, joints.child]
    unit = jnp.broadcast_to(jnp.array([1.0, 0.0, 0.0, 0.0]), (*at.shape[:2], 4))
    parent, child = (
        (pos[:, joints.parent_body], quat[:, joints.parent_body]),
        (pos[:, joints.child_body], quat[:, joints.child_body]),
    )
    on_child, _ = relative_pose(*child, at, unit)
    on_parent, _ = relative_pose(*parent, at, unit)
    _, turned = relative_pose(*parent, *child)
    return jnp.concatenate([on_child, on_parent, turned], axis=-1)


def stretched(joints: Joints, place: Float[Array, "W N 10"], view: PhysicsView) -> Float[Array, "W N"]:
    """m between the two ends of each joint."""
    pos, quat = jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)
    one = pos[:, joints.child_body] + quat_rotate(quat[:, joints.child_body], place[..., :3])
    other = pos[:, joints.parent_body] + quat_rotate(quat[:, joints.parent_body], place[..., 3:6])
    return length(one - other)


def places(joints: Joints, view: PhysicsView) -> Float[Array, "W N 3"]:
    """Where pairs are attached, m, world frame; NaN: anywhere."""
    pos, quat = (jnp.asarray(x)[:, joints.parent_body] for x in (view.body_pos, view.body_quat))
    return pos + quat_rotate(quat, joints.place)


def at_place(joints: Joints, view: PhysicsView) -> Bool[Array, "W N"]:
    """Whether each child is where it can be attached."""
    anywhere = np.isnan(joints.place[:, 0])
    if anywhere.all():
        return jnp.ones((view.object_com.shape[0], len(anywhere)), bool)
    low, high = (jnp.asarray(x)[:, joints.child] for x in (view.aabb_low, view.aabb_high))
    at = places(joints, view)
    gap = jnp.maximum(jnp.maximum(low - at, at - high), 0.0)
    return anywhere | (jnp.sum(gap * gap, axis=-1) <= NEAR**2)


def _after(step: EventStep) -> tuple[Bool[Array, "W N"], Bool[Array, "W N"], Bool[Array, "W N"]]:
    """What is attached after this step, which of it is new, and which pairs have to come apart first."""
    joints, states = of(step.model), step.states
    attached, waits = jnp.asarray(states.attached), jnp.asarray(states.parting)
    touching = jnp.asarray(step.view.touching)[:, joints.child, joints.parent]
    off = attached & (stretched(joints, jnp.asarray(states.joint_place), step.view) > APART)
    kept = attached & ~off
    same = joints.child[:, None] == joints.child
    taken = jnp.any(kept[:, None] & same, axis=-1)
    able = touching & ~taken & ~waits & ~off & at_place(joints, step.view)
    new = able & ~jnp.any(able[:, None] & np.tril(same, -1), axis=-1)
    return kept | new, new, (waits | off) & touching


def _update(step: EventStep) -> EventStep:
    attached, new, waits = _after(step)
    place = jnp.where(new[..., None], parameters(of(step.model), step.view), jnp.asarray(step.states.joint_place))
    return step.having(attached=attached, parting=waits, joint_place=place)


def _idle(step: EventStep) -> Bool[Array, ""]:
    attached, new, waits = _after(step)
    states = step.states
    return ~jnp.any(new) & jnp.all(attached == states.attached) & jnp.all(waits == states.parting)


def set_attached(
    model: StateModel, states: ExtendedStates, number: int, value: bool, view: PhysicsView
) -> ExtendedStates:
    """The states in which a pair is attached as it is now, or is not; of NumPy arrays NumPy arrays."""
    joints = of(model)
    own = np.arange(len(joints.child)) == number
    xp = np if isinstance(states.attached, np.ndarray) else jnp
    place = xp.asarray(parameters(joints, view))
    others = (joints.child == joints.child[number]) & ~own
    attached = xp.where(own, value, states.attached)
    return dataclasses.replace(
        states,
        attached=xp.where(others & value, False, attached),
        parting=xp.where(own, not value, states.parting),
        joint_place=xp.where(own[:, None] & value, place, states.joint_place).astype(np.float32),
    )


def _initial(model: StateModel) -> dict[str, np.ndarray]:
    count = len(of(model).child)
    place = np.zeros((1, count, 10), np.float32)
    place[..., 6] = 1.0
    return {"attached": np.zeros((1, count), bool), "parting": np.zeros((1, count), bool), "joint_place": place}


def _from_manifest(saved: Saved) -> None:
    """A manifest says nothing of it."""


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> str:
    joints = of(model)
    on = np.flatnonzero(np.asarray(states.attached)[world] & (joints.child == obj))
    return model.tables.object_names[joints.parent[on[0]]] if len(on) else ""


SPEC = StateSpec(
    name="attached",
    get=_get,
    abilities=None,
    extra=ATTACHED,
    fields={
        "attached": Bool[Array, "W N"],
        "parting": Bool[Array, "W N"],
        "joint_place": Float[Array, "W N 10"],
    },
    initial=_initial,
    update=_update,
    idle=_idle,
    inherit=nothing_inherited,
    from_manifest=_from_manifest,
)
