"""`ModelLayout`: how a compiled model's trees, joints and geoms belong to the scene's objects. Shared by the engines.

A *unit* is the part of an object that sleeps and wakes as one: its static part, or one kinematic tree of it (a fixed
cabinet with two drawers has three units). Touching is remembered per pair of units, because two units that sleep have
no contacts in MuJoCo, and an object may be half awake.

Axes: O objects, U units, T trees, B bodies, G geoms, L annotated links, E equality constraints.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.errors import EngineError
from ig2mj.scene.tables import SceneTables


@dataclasses.dataclass(frozen=True, eq=False)
class ModelLayout:
    """Index arrays, all on the host.

    Attributes:
      object_qposadr, object_dofadr: addresses of the free joint of the object's main body, -1 for fixed objects.
      object_trees: [O, T] the object owns bodies of the tree.
      extra_object, extra_qposadr, extra_dofadr: free joints of bodies split off an object.
      unit_object, unit_agent, unit_tree: owner of each unit, an object or an agent (the other one is -1), and its
        tree; tree -1: the owner's static part.
      body_unit, geom_unit: unit of each body and geom; -1: none (the world).
      collides: [G] the geom takes part in contacts and belongs to an object or an agent.
      link_of_geom: [G] annotated link whose geom it is, -1 none.
      hand_of_geom: [G] hand that the geom is part of, -1 none.
      finger_of_geom, graspable_of_geom: [G] finger link, and graspable body, whose geom it is, -1 none. What is welded
        to a graspable body is part of it.
      qpos_tree, qpos_dof: [nq] tree and first degree of freedom of the joint that owns the coordinate.
      qpos_ndof: [nq] number of degrees of freedom of that joint.
      equality_tree: [E, 2] trees that an equality constraint joins, -1: the world or nothing.
      scene_sizes: how long the scene's part of each field of `ig2mj.engine.snapshot.AXIS` is; the agents' part follows.
      grasp_equality, grasp_hand, grasp_object: equality constraints between a hand's body and an object's.
      grasp_body: the two bodies of each. grasp_coordinates: [grasps, D] addresses in qpos that move one of them, those
        of all joints between a body and the world; -1: none.
    """

    object_qposadr: Int[np.ndarray, "O"]
    object_dofadr: Int[np.ndarray, "O"]
    object_trees: Bool[np.ndarray, "O T"]
    extra_object: Int[np.ndarray, "X"]
    extra_qposadr: Int[np.ndarray, "X"]
    extra_dofadr: Int[np.ndarray, "X"]
    unit_object: Int[np.ndarray, "U"]
    unit_agent: Int[np.ndarray, "U"]
    unit_tree: Int[np.ndarray, "U"]
    body_unit: Int[np.ndarray, "B"]
    geom_unit: Int[np.ndarray, "G"]
    collides: Bool[np.ndarray, "G"]
    link_of_geom: Int[np.ndarray, "G"]
    hand_of_geom: Int[np.ndarray, "G"]
    finger_of_geom: Int[np.ndarray, "G"]
    graspable_of_geom: Int[np.ndarray, "G"]
    qpos_tree: Int[np.ndarray, "nq"]
    qpos_dof: Int[np.ndarray, "nq"]
    qpos_ndof: Int[np.ndarray, "nq"]
    equality_tree: Int[np.ndarray, "E 2"]
    scene_sizes: Mapping[str, int]
    grasp_equality: Int[np.ndarray, "grasps"]
    grasp_hand: Int[np.ndarray, "grasps"]
    grasp_object: Int[np.ndarray, "grasps"]
    grasp_body: Int[np.ndarray, "grasps 2"]
    grasp_coordinates: Int[np.ndarray, "grasps D"]

    @property
    def num_units(self) -> int:
        return len(self.unit_object)

    @property
    def num_object_units(self) -> int:
        """V: units of objects are the first ones."""
        return int((self.unit_object >= 0).sum())

    @property
    def object_linear_dofs(self) -> Int[np.ndarray, "N 3"]:
        """Degrees of freedom in which each free body of an object moves along the axes."""
        first = np.concatenate([self.object_dofadr[self.object_dofadr >= 0], self.extra_dofadr])
        return first[:, None].astype(int) + np.arange(3)


def make_layout(model: mujoco.MjModel, tables: SceneTables) -> ModelLayout:
    """Derives the layout of a compiled scene."""
    body_object, num_objects = tables.body_object, tables.num_objects
    body_tree = np.asarray(model.body_treeid)
    owned = body_object >= 0

    object_trees = np.zeros((num_objects, model.ntree), bool)
    moving = owned & (body_tree >= 0)
    object_trees[body_object[moving], body_tree[moving]] = True

    # Objects are owners 0 to O - 1, agents those from O on.
    owner = np.where(owned, body_object, np.where(tables.body_agent >= 0, num_objects + tables.body_agent, -1))
    pairs = np.stack([owner, body_tree], 1)
    units = np.unique(pairs[owner >= 0], axis=0) if (owner >= 0).any() else np.zeros((0, 2), int)
    number = {tuple(pair): k for k, pair in enumerate(units.tolist())}
    body_unit = np.array([number.get(tuple(pair), -1) for pair in pairs.tolist()], int)

    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    free = free[body_object[model.jnt_bodyid[free]] >= 0]
    free_body = model.jnt_bodyid[free]
    is_root = tables.object_root[body_object[free_body]] == free_body
    object_qposadr, object_dofadr = np.full(num_objects, -1), np.full(num_objects, -1)
    object_qposadr[body_object[free_body[is_root]]] = model.jnt_qposadr[free[is_root]]
    object_dofadr[body_object[free_body[is_root]]] = model.jnt_dofadr[free[is_root]]
    extra = free[~is_root]

    geom_body = np.asarray(model.geom_bodyid)
    collides = ((model.geom_contype != 0) | (model.geom_conaffinity != 0)) & (body_unit[geom_body] >= 0)
    link_of_geom = np.full(model.ngeom, -1)
    with_geom = np.flatnonzero(tables.link_geom >= 0)
    link_of_geom[tables.link_geom[with_geom]] = with_geom

    finger_of_body = _with_welded(model, tables.finger_body)
    graspable_of_body = _with_welded(model, tables.graspable_body)

    width = np.where(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE, 7, 1)
    width[model.jnt_type == mujoco.mjtJoint.mjJNT_BALL] = 4
    joint_ndof = np.select([width == 7, width == 4], [6, 3], 1)
    joint = np.repeat(np.arange(model.njnt), width)

    equality_body = _equality_bodies(model)
    equality, hand, grasped = _grasps(tables, equality_body)
    return ModelLayout(
        object_qposadr=object_qposadr,
        object_dofadr=object_dofadr,
        object_trees=object_trees,
        extra_object=body_object[model.jnt_bodyid[extra]],
        extra_qposadr=np.asarray(model.jnt_qposadr)[extra],
        extra_dofadr=np.asarray(model.jnt_dofadr)[extra],
        unit_object=np.where(units[:, 0] < num_objects, units[:, 0], -1),
        unit_agent=np.where(units[:, 0] < num_objects, -1, units[:, 0] - num_objects),
        unit_tree=units[:, 1],
        body_unit=body_unit,
        geom_unit=body_unit[geom_body],
        collides=collides,
        link_of_geom=link_of_geom,
        hand_of_geom=tables.body_hand[geom_body],
        finger_of_geom=finger_of_body[geom_body],
        graspable_of_geom=graspable_of_body[geom_body],
        qpos_tree=body_tree[model.jnt_bodyid[joint]],
        qpos_dof=np.asarray(model.jnt_dofadr)[joint],
        qpos_ndof=joint_ndof[joint],
        equality_tree=np.where(equality_body >= 0, body_tree[equality_body], -1),
        scene_sizes=_scene_sizes(model, tables, equality_body),
        grasp_equality=equality,
        grasp_hand=hand,
        grasp_object=grasped,
        grasp_body=equality_body[equality],
        grasp_coordinates=_moving_coordinates(model, equality_body[equality], width),
    )


def _scene_sizes(model: mujoco.MjModel, tables: SceneTables, equality_body: np.ndarray) -> dict[str, int]:
    """Raises EngineError where something of the scene comes after something of an agent."""
    of_agent = tables.body_agent >= 0
    of_joint, of_dof = of_agent[model.jnt_bodyid], of_agent[model.dof_bodyid]
    mocap = np.flatnonzero(model.body_mocapid >= 0)
    trees = np.zeros(model.ntree, bool)
    trees[model.dof_treeid] = of_dof
    equality = (of_agent[np.maximum(equality_body, 0)] & (equality_body >= 0)).any(1)
    activations = np.repeat(tables.actuator_agent >= 0, model.actuator_actnum)
    axes = {
        "qpos": np.repeat(of_joint, np.diff(np.append(model.jnt_qposadr, model.nq)).astype(int)),
        "qvel": of_dof,
        "qacc_warmstart": of_dof,
        "act": activations,
        "ctrl": tables.actuator_agent >= 0,
        "eq_active": equality,
        "eq_data": equality,
        "mocap_pos": of_agent[mocap],
        "mocap_quat": of_agent[mocap],
        "tree_asleep": trees,
    }
    for name, agents in axes.items():
        if (np.diff(agents.astype(int)) < 0).any():
            raise EngineError(f"{name} of agents comes before that of objects: scene.xml must have its agents last")
    return {name: int((~agents).sum()) for name, agents in axes.items()}


def _with_welded(model: mujoco.MjModel, bodies: np.ndarray) -> np.ndarray:
    """Place in `bodies` of each body [B] that is one of them or hangs on one by no joint; -1 for all others."""
    place = np.full(model.nbody, -1)
    place[bodies] = np.arange(len(bodies))
    for body in range(1, model.nbody):  # parents come first
        if place[body] < 0 and model.body_jntnum[body] == 0:
            place[body] = place[model.body_parentid[body]]
    return place


def _equality_bodies(model: mujoco.MjModel) -> np.ndarray:
    """Bodies [E, 2] that each equality constraint joins; -1: none (a joint held at a value)."""
    out = np.full((model.neq, 2), -1)
    for e in range(model.neq):
        ids = np.array([model.eq_obj1id[e], model.eq_obj2id[e]])
        kind = mujoco.mjtEq(int(model.eq_type[e]))
        if kind in (mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT):
            of_site = model.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE
            out[e] = model.site_bodyid[ids] if of_site else ids
        elif kind == mujoco.mjtEq.mjEQ_JOINT:
            out[e] = np.where(ids >= 0, model.jnt_bodyid[ids], -1)
    return out


def _moving_coordinates(model: mujoco.MjModel, bodies: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Addresses in qpos [n, D] of all joints between each row's bodies [n, 2] and the world, padded with -1.

    Args:
      width: [njnt] coordinates of each joint.
    """
    own: dict[int, list[int]] = {0: []}
    for body in range(1, model.nbody):  # parents come first
        first = int(model.body_jntadr[body])
        joints = range(first, first + int(model.body_jntnum[body]))
        address = [int(model.jnt_qposadr[j]) + k for j in joints for k in range(int(width[j]))]
        own[body] = own[int(model.body_parentid[body])] + address
    rows = [own[int(one)] + own[int(other)] for one, other in bodies]
    most = max([1, *map(len, rows)])
    return np.array([[*row, *[-1] * (most - len(row))] for row in rows], int).reshape(-1, most)


def _grasps(tables: SceneTables, equality_body: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Welds and connects that join a hand to an object: equality ids, hands, objects."""
    rows = []
    for e, bodies in enumerate(equality_body):
        for one, other in (bodies, bodies[::-1]):
            if one < 0 or other < 0:
                continue
            hand, held = int(tables.body_hand[one]), int(tables.body_object[other])
            if hand >= 0 and held >= 0:
                rows.append((e, hand, held))
    table = np.array(rows, int).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]
