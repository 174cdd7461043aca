"""`PhysicsView` from MJX arrays, shared by the two MJX engines. Pure JAX, all worlds at once.

What is not read costs nothing: the view is made inside the jitted step, and XLA drops the parts that no state,
predicate or reward uses.

Axes as in `ig2mj.engine.base` and `ig2mj.engine.view`; K boxed items of a `BoxTable`, V units of objects, S slots (the
most boxed items, or units, of an owner).
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jax.experimental.layout import Layout, with_layout_constraint
from jaxtyping import Bool, Float

from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.mjx.touching import of_owners, packed
from ig2mj.engine.mjx.velocities import JointsAbove, Moved, body_velocities, joints_above
from ig2mj.engine.object_boxes import BoxTable, make_box_table
from ig2mj.engine.view import AgentView, Array, PhysicsView
from ig2mj.geometry.boxes import OUTWARDS
from ig2mj.geometry.poses import compose, quat_rotate, quats_to_matrices
from ig2mj.scene.tables import SceneTables


@dataclasses.dataclass(frozen=True, eq=False)
class ViewPlan:
    """Index arrays for `make_view`, on the host.

    Attributes:
      tables, layout, boxes: constants of the scene.
      com_offset: [O, 3] centre of mass of the main body in its frame.
      box_slots, unit_slots: [O, S] rows of the box table, and units, of each object; -1 none. agent_slots: [A, S].
      grasp_slots: [H * O, S] equality constraints by which each hand holds each object; -1 none.
      free: objects that are free. base_joints, hand_joints: what moves bases and hands.
      qpos_openable: [J]. camera_body, camera_pos, camera_quat: [A...] eyes in their bodies' frames.
    """

    tables: SceneTables
    layout: ModelLayout
    boxes: BoxTable
    com_offset: np.ndarray
    box_slots: np.ndarray
    unit_slots: np.ndarray
    agent_slots: np.ndarray
    grasp_slots: np.ndarray
    free: np.ndarray
    base_joints: JointsAbove
    hand_joints: JointsAbove
    camera_body: np.ndarray
    camera_pos: np.ndarray
    camera_quat: np.ndarray


def plan_view(model: mujoco.MjModel, tables: SceneTables, layout: ModelLayout, box_rule: str) -> ViewPlan:
    """Prepares the view of a scene; `box_rule` as in `ig2mj.engine.base.BOX_RULES`."""
    boxes = make_box_table(box_rule, model, tables, layout)
    camera = tables.agent_camera
    known = camera >= 0
    return ViewPlan(
        tables=tables,
        layout=layout,
        boxes=boxes,
        com_offset=np.asarray(model.body_ipos)[tables.object_root],
        box_slots=slots(boxes.owner, tables.num_objects),
        unit_slots=slots(layout.unit_object, tables.num_objects),
        agent_slots=slots(layout.unit_agent, len(tables.agent_names)),
        grasp_slots=_grasp_slots(tables, layout),
        free=np.flatnonzero(layout.object_dofadr >= 0),
        base_joints=joints_above(model, tables.agent_body),
        hand_joints=joints_above(model, tables.hand_body),
        camera_body=np.where(known, model.cam_bodyid[camera] if model.ncam else 0, tables.agent_body),
        camera_pos=np.where(known[:, None], model.cam_pos[camera] if model.ncam else 0.0, np.zeros(3)),
        camera_quat=np.where(known[:, None], model.cam_quat[camera] if model.ncam else 0.0, [1.0, 0.0, 0.0, 0.0]),
    )


def make_view(
    plan: ViewPlan,
    moved: Moved,
    tree_awake: Bool[Array, "W T"],
    touching: Bool[Array, "W U U"],
    link_force: Float[Array, "W L O"],
    finger_force: Float[Array, "W F Y"],
    eq_active: Bool[Array, "W E"],
) -> PhysicsView:
    """The view of poses, velocities, contacts and sleep. `touching` is of units; forces in newtons."""
    tables, layout = plan.tables, plan.layout
    body_pos, body_quat = moved.xpos, moved.xquat
    root, words = tables.object_root, packed(jnp.asarray(touching))
    object_pos, object_quat = body_pos[:, root], body_quat[:, root]
    linvel, angvel = _object_velocities(plan, moved.qvel, object_quat)
    link_pos, link_quat = compose(
        body_pos[:, tables.link_body],
        body_quat[:, tables.link_body],
        jnp.asarray(tables.link_pos, jnp.float32),
        jnp.asarray(tables.link_quat, jnp.float32),
    )
    low, high = object_boxes(plan, body_pos, body_quat)
    return PhysicsView(
        object_pos=object_pos,
        object_quat=object_quat,
        object_linvel=linvel,
        object_angvel=angvel,
        object_com=object_pos + quat_rotate(object_quat, jnp.asarray(plan.com_offset, jnp.float32)),
        aabb_low=low,
        aabb_high=high,
        body_pos=body_pos,
        body_quat=body_quat,
        link_pos=link_pos,
        link_quat=link_quat,
        joint_pos=moved.qpos[:, tables.openable_qposadr],
        touching=of_owners(words, plan.unit_slots, plan.unit_slots) & ~np.eye(tables.num_objects, dtype=bool),
        link_force=link_force,
        awake=_any_of(tree_awake, layout.object_trees),
        held=_held(plan, eq_active),
        agent=_agents(plan, moved, of_owners(words, plan.agent_slots, plan.unit_slots), finger_force),
    )


def _agents(
    plan: ViewPlan, moved: Moved, touching: Bool[Array, "W A O"], finger_force: Float[Array, "W F Y"]
) -> AgentView:
    tables, body_pos, body_quat = plan.tables, moved.xpos, moved.xquat
    eye_pos, eye_quat = compose(
        body_pos[:, plan.camera_body],
        body_quat[:, plan.camera_body],
        jnp.asarray(plan.camera_pos, jnp.float32),
        jnp.asarray(plan.camera_quat, jnp.float32),
    )
    base_linvel, base_angvel = body_velocities(plan.base_joints, moved)
    hand_linvel, hand_angvel = body_velocities(plan.hand_joints, moved)
    return AgentView(
        base_pos=body_pos[:, tables.agent_body],
        base_quat=body_quat[:, tables.agent_body],
        base_linvel=base_linvel,
        base_angvel=base_angvel,
        eye_pos=eye_pos,
        eye_quat=eye_quat,
        joint_pos=moved.qpos[:, tables.agent_joint_qposadr],
        joint_vel=moved.qvel[:, tables.agent_joint_dofadr],
        hand_pos=body_pos[:, tables.hand_body],
        hand_quat=body_quat[:, tables.hand_body],
        hand_linvel=hand_linvel,
        hand_angvel=hand_angvel,
        finger_pos=body_pos[:, tables.finger_body],
        finger_quat=body_quat[:, tables.finger_body],
        finger_force=finger_force,
        touching=touching,
    )


def _object_velocities(
    plan: ViewPlan, qvel: Float[Array, "W nv"], object_quat: Float[Array, "W O 4"]
) -> tuple[Float[Array, "W O 3"], Float[Array, "W O 3"]]:
    """Linear and angular velocities of main bodies; a free joint's are linear in the world's axes, angular in its
    body's."""
    zero = jnp.zeros((*object_quat.shape[:2], 3), jnp.float32)
    if not len(plan.free):
        return zero, zero
    velocity = qvel[:, plan.layout.object_dofadr[plan.free, None] + np.arange(6)]
    angular = quat_rotate(object_quat[:, plan.free], velocity[..., 3:])
    return zero.at[:, plan.free].set(velocity[..., :3]), zero.at[:, plan.free].set(angular)


def object_boxes(
    plan: ViewPlan, body_pos: Float[Array, "W B 3"], body_quat: Float[Array, "W B 4"]
) -> tuple[Float[Array, "W O 3"], Float[Array, "W O 3"]]:
    """World boxes of all objects, low and high corners (m); as `ig2mj.engine.object_boxes.world_boxes` makes them."""
    bodies = plan.boxes.body
    position, rotation = _worlds_last(body_pos), quats_to_matrices(_worlds_last(body_quat))
    reach = plan.boxes.reaches(rotation[:, :, bodies]) + OUTWARDS[:, 0] * position[bodies].swapaxes(0, 1)  # 2 3 K W
    slot = np.where(plan.box_slots >= 0, plan.box_slots, plan.box_slots[:, :1])  # every object has at least one box
    farthest = reach[:, :, slot[:, 0]]
    for s in range(1, slot.shape[1]):
        farthest = jnp.maximum(farthest, reach[:, :, slot[:, s]])
    low, high = jnp.moveaxis(_in_order(farthest), -1, 1).swapaxes(2, 3)
    return -low, high


def _worlds_last(values: Float[Array, "W n c"]) -> Float[jax.Array, "n c W"]:
    return _in_order(jnp.moveaxis(jnp.asarray(values), 0, -1))


def _in_order(values: Float[jax.Array, "*n"]) -> Float[jax.Array, "*n"]:
    """The same in memory in the order of its axes; else XLA would call another order a transposed array, and each
    thread of a GPU would read far from its neighbour's."""
    return with_layout_constraint(values, Layout(tuple(range(values.ndim))))


def slots(owner: np.ndarray, count: int) -> np.ndarray:
    """Places [count, S] of each owner's entries in `owner` [n], ascending, padded with -1."""
    rows = [np.flatnonzero(owner == o) for o in range(count)]
    width = max((len(r) for r in rows), default=0)
    table = np.full((count, max(width, 1)), -1)
    for o, r in enumerate(rows):
        table[o, : len(r)] = r
    return table


def _any_of(values: Bool[Array, "W T"], owned: np.ndarray) -> Bool[Array, "W O"]:
    """Whether any tree an object owns [O, T] holds."""
    table = [np.flatnonzero(row) for row in owned]
    width = max((len(r) for r in table), default=0)
    result = jnp.zeros((values.shape[0], len(owned)), bool)
    for s in range(width):
        has = np.array([len(r) > s for r in table])
        tree = np.array([r[s] if len(r) > s else 0 for r in table])
        result |= values[:, tree] & has
    return result


def _grasp_slots(tables: SceneTables, layout: ModelLayout) -> np.ndarray:
    """`ViewPlan.grasp_slots`."""
    pair = np.asarray(layout.grasp_hand, int) * tables.num_objects + np.asarray(layout.grasp_object, int)
    slot = slots(pair, len(tables.hand_body) * tables.num_objects)
    if not len(layout.grasp_equality):
        return slot
    return np.where(slot >= 0, np.asarray(layout.grasp_equality)[slot], -1)


def _held(plan: ViewPlan, eq_active: Bool[Array, "W E"]) -> Bool[Array, "W H O"]:
    """A gather for each slot: where a program knows `eq_active` of all worlds beforehand, as at a start, XLA works a
    scatter out while it compiles, one element after the other (5 s for 8,192 worlds)."""
    worlds, tables = eq_active.shape[0], plan.tables
    shape = worlds, len(tables.hand_body), tables.num_objects
    if not len(plan.layout.grasp_equality):
        return jnp.zeros(shape, bool)
    held = jnp.zeros((worlds, len(plan.grasp_slots)), bool)
    for slot in plan.grasp_slots.T:
        held |= eq_active[:, slot] & (slot >= 0)
    return held.reshape(shape)
