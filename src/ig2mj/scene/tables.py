"""`SceneTables`: the scene's constants as numpy arrays, ready to be closed over by jitted functions.

Axes: O objects, B bodies, G geoms, J openable joints, L annotated links, K convex collision pieces (one per collision
geom), V vertices and N half-spaces of the largest piece (padded), A agents, H hands, F finger links, Q scalar joints of
agents, Y graspable bodies, nu actuators.
"""

from __future__ import annotations

import dataclasses
import enum

import numpy as np
from jaxtyping import Bool, Float, Int


class PieceKind(enum.IntEnum):
    """Shape of a convex piece. Boxes are POLYHEDRON too: their half-spaces are filled in."""

    SPHERE = 0
    CAPSULE = 1
    CYLINDER = 2
    POLYHEDRON = 3


class LinkKind(enum.IntEnum):
    """Kind of annotated link (paper table A.3)."""

    HEAT_SOURCE = 0
    TOGGLE_BUTTON = 1
    WATER_SOURCE = 2
    WATER_SINK = 3
    SLICER = 4
    CLEANING_TOOL_AREA = 5


@dataclasses.dataclass(frozen=True, eq=False)
class SceneTables:
    """Constants of a scene. Built by `ig2mj.scene.load_scene`; never changes during a run.

    Attributes:
      object_names, object_categories: O strings each.
      object_fixed: no free joint. object_root: main body. object_part_of: index of the whole of which the object is a
        half, else -1. object_parked: starts out of use.
      object_is_floor: category "floors"; object_mass: kg, whole object.
      object_bbox: bounding box at joint positions 0, base axes. object_bbox_center: its centre in the base frame.
      body_object, geom_object: owner of each body and geom, -1 for none (the world, agents).
      body_rests: it belongs to an object, and no joint is between it and the world: it never moves.
      body_rest_pos, body_rest_quat: where it is then (m, w-x-y-z); of other bodies, where they start.
      openable_*: joints that count for Open: owner, address in qpos, closed and open end.
      object_both_sides: `openable_both_sides`.
      link_*: annotated links: owner, kind, body they ride on, pose in that body, geom id (-1: a site), half size (0: a
        site).
      piece_*: convex collision pieces of objects: geom id, owner, body, pose in the body, kind, size as MuJoCo's
        geom_size for the primitive kinds; half-spaces (n, d) with n.x <= d in the piece's frame, padded with
        (0, 0, 0, 1); vertices in the piece's frame, padded by repeating the first one (of a round primitive the corners
        of its box).
      room_names: room instances; room_types: type of each. room_map: index + 1 of the room instance per pixel, 0 none;
        row is y, column is x (iGibson's dataset format). room_resolution: metres a pixel.
      object_rooms: annotated rooms of fixed objects, [O, R].
      agent_*: base body, camera id (-1 none), vertical field of view (radians).
      body_agent, body_hand: agent and hand that each body is part of, -1 none. A hand is its palm, everything that
        hangs on the palm, and its fingers.
      agent_joint_*: hinges and slides of the agents' bodies, by agent and then in the model's order: name, agent,
        addresses in qpos and qvel.
      actuator_agent: agent that each actuator moves, -1 none.
      hand_*: palm or end effector body, agent. finger_*: finger link, its agent, its hand (-1: none is known).
      graspable_*: bodies that a hand can take hold of: the main body of every movable object that allows assisted
        grasps, then the moving link of every openable joint of fixed objects: body, object, and J of that joint (-1 for
        a movable object).
    """

    object_names: tuple[str, ...]
    object_categories: tuple[str, ...]
    object_fixed: Bool[np.ndarray, "O"]
    object_root: Int[np.ndarray, "O"]
    object_part_of: Int[np.ndarray, "O"]
    object_parked: Bool[np.ndarray, "O"]
    object_is_floor: Bool[np.ndarray, "O"]
    object_mass: Float[np.ndarray, "O"]
    object_bbox: Float[np.ndarray, "O 3"]
    object_bbox_center: Float[np.ndarray, "O 3"]
    object_both_sides: Bool[np.ndarray, "O"]
    object_rooms: Bool[np.ndarray, "O R"]
    body_object: Int[np.ndarray, "B"]
    body_rests: Bool[np.ndarray, "B"]
    body_rest_pos: Float[np.ndarray, "B 3"]
    body_rest_quat: Float[np.ndarray, "B 4"]
    geom_object: Int[np.ndarray, "G"]
    openable_object: Int[np.ndarray, "J"]
    openable_qposadr: Int[np.ndarray, "J"]
    openable_closed: Float[np.ndarray, "J"]
    openable_open: Float[np.ndarray, "J"]
    link_object: Int[np.ndarray, "L"]
    link_kind: Int[np.ndarray, "L"]
    link_body: Int[np.ndarray, "L"]
    link_geom: Int[np.ndarray, "L"]
    link_pos: Float[np.ndarray, "L 3"]
    link_quat: Float[np.ndarray, "L 4"]
    link_half: Float[np.ndarray, "L 3"]
    piece_geom: Int[np.ndarray, "K"]
    piece_object: Int[np.ndarray, "K"]
    piece_body: Int[np.ndarray, "K"]
    piece_pos: Float[np.ndarray, "K 3"]
    piece_quat: Float[np.ndarray, "K 4"]
    piece_kind: Int[np.ndarray, "K"]
    piece_size: Float[np.ndarray, "K 3"]
    piece_planes: Float[np.ndarray, "K N 4"]
    piece_vertices: Float[np.ndarray, "K V 3"]
    room_names: tuple[str, ...]
    room_types: tuple[str, ...]
    room_map: Int[np.ndarray, "rows columns"]
    room_resolution: float
    agent_names: tuple[str, ...]
    agent_body: Int[np.ndarray, "A"]
    agent_camera: Int[np.ndarray, "A"]
    agent_fovy: Float[np.ndarray, "A"]
    body_agent: Int[np.ndarray, "B"]
    body_hand: Int[np.ndarray, "B"]
    agent_joint_names: tuple[str, ...]
    agent_joint_agent: Int[np.ndarray, "Q"]
    agent_joint_qposadr: Int[np.ndarray, "Q"]
    agent_joint_dofadr: Int[np.ndarray, "Q"]
    actuator_agent: Int[np.ndarray, "nu"]
    hand_body: Int[np.ndarray, "H"]
    hand_agent: Int[np.ndarray, "H"]
    finger_body: Int[np.ndarray, "F"]
    finger_agent: Int[np.ndarray, "F"]
    finger_hand: Int[np.ndarray, "F"]
    graspable_body: Int[np.ndarray, "Y"]
    graspable_object: Int[np.ndarray, "Y"]
    graspable_joint: Int[np.ndarray, "Y"]

    @property
    def num_objects(self) -> int:
        return len(self.object_names)
