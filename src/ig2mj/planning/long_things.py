"""Long things are carried upright where there is no way with them lying in the hand: a broom in a narrow bathroom."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical, matrix_to_quat, quat_to_rotation_vector, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.moves import TOUCHES, UP, Program, vector3
from ig2mj.planning.phases import Phase
from ig2mj.planning.world import BODY_SPARE, HIGHEST, PlannedWorld, Rotation, Vector

LONG, LIES = 0.7, 0.7
"""m from which on something is long; sine of the angle of its long axis with the horizontal up to which it lies."""

LOWEST = 0.12
"""m above the floor that the lower end of what is carried upright keeps, at least."""

OFFSETS = sorted(itertools.product((0.0, 0.1, 0.2), (0.0, 0.1, -0.1, 0.2, -0.2)), key=lambda offset: np.hypot(*offset))
"""m ahead and to the side of where it is carried, at which it may be turned."""

SHARES = np.linspace(0.0, 1.0, 7)
"""Of the turn, at which what is turned keeps clear."""


def stood_up(world: PlannedWorld, hand: int) -> Program:
    """The program in which a floating hand turns what it holds until that stands upright in front of the body; empty:
    it is not long, stands already, or has no room for that."""
    name, grip = world.held[hand], world.grip(hand)
    corners = world.vertices(name) - grip
    axis = np.linalg.svd(corners - corners.mean(0), full_matrices=False)[2][0]
    if np.ptp(corners @ axis) < LONG or abs(float(axis @ UP)) > LIES:
        return []
    obstacles = world.obstacles([name], world.stance)
    spheres = world.spheres(*world.hand_axes(hand), holding=name, hand=hand) * (1.0, 1.0, 1.0, TOUCHES)
    for end in (axis, -axis) if axis @ UP >= 0.0 else (-axis, axis):
        turns = _shares(turn_onto(end, UP))
        stands = corners @ turns[-1].T
        low, high = float(stands[:, 2].min()), float(stands[:, 2].max())
        if high - low > HIGHEST - LOWEST:
            return []
        x = world.body.trunk[0] + BODY_SPARE + float(np.linalg.norm(stands[:, :2], axis=1).max())
        places = world.from_body(np.zeros(3)) + [
            about_vertical(world.stance.yaw) @ (x + ahead, float(world.body.carry[hand][1]) + aside, 0.0)
            for ahead, aside in OFFSETS
        ]
        places[:, 2] = np.clip(grip[2], LOWEST - low, HIGHEST - high)
        turned = [_turned(spheres, turn) for turn in turns]
        for point in places:
            if all(obstacles.clear(some + np.array([*point, 0.0])) for some in turned):
                return _turning(world, hand, point, turns[-1])
    return []


def _turning(world: PlannedWorld, hand: int, point: Vector, rotation: Rotation) -> Program:
    """Takes what a hand holds to a point, and turns it there."""
    keeps, quat = world.index(world.held[hand]), world.turned_hand(hand, rotation)
    there = Phase(hand=hand, pos=vector3(point), keeps=keeps, tolerance=0.05, limit=40, after="")
    return [there, dataclasses.replace(there, quat=quat, turn_tolerance=0.15, limit=60)]


def _shares(rotation: Rotation) -> list[Rotation]:
    """Rotations by `SHARES` of the angle of one."""
    vector = quat_to_rotation_vector(np.asarray(matrix_to_quat(rotation), float))
    angle = float(np.linalg.norm(vector))
    half = SHARES[:, None] * angle / 2
    quats = np.concatenate([np.cos(half), np.sin(half) * vector / max(angle, 1e-9)], axis=1)
    return list(matrices_on_host(quats))


def _turned(spheres: Float[np.ndarray, "S 4"], rotation: Rotation) -> Float[np.ndarray, "S 4"]:
    return np.concatenate([spheres[:, :3] @ rotation.T, spheres[:, 3:]], axis=1)
