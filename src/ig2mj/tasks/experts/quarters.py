"""Views of a world turned by quarters about the vertical: as it would be seen in a home that is turned against it."""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import AgentView, Array, LazyFields, PhysicsView
from ig2mj.geometry.poses import quat_multiply, quat_rotate

POINTS = ("_pos", "_com", "linvel", "angvel")
"""How names of fields end that are vectors of the world frame, if they have three numbers."""


def quarter_turn(degrees: int) -> Float[np.ndarray, "4"]:
    """w-x-y-z of a turn about the vertical."""
    half = math.radians(degrees) / 2
    return np.array([math.cos(half), 0.0, 0.0, math.sin(half)], np.float32)


def turned_view(view: PhysicsView, turn: Float[np.ndarray, "4"]) -> PhysicsView:
    """The view of the same world turned about the origin; a multiple of 90 degrees. Fields are turned when read."""

    def of_agents(name: str) -> Any:
        return _turned(name, getattr(view.agent, name), turn)

    agent = AgentView.over(LazyFields({}, of_agents))

    def field(name: str) -> Any:
        if name == "agent":
            return agent
        if name in ("aabb_low", "aabb_high"):
            corners = [quat_rotate(turn, jnp.asarray(corner)) for corner in (view.aabb_low, view.aabb_high)]
            return (jnp.minimum if name == "aabb_low" else jnp.maximum)(*corners)
        return _turned(name, getattr(view, name), turn)

    return PhysicsView.over(LazyFields({}, field))


def _turned(name: str, array: Array, turn: Float[np.ndarray, "4"]) -> Array:
    if name.endswith("_quat"):
        return quat_multiply(jnp.asarray(turn), jnp.asarray(array))
    if name.endswith(POINTS) and array.shape[-1] == 3 and name != "joint_pos":
        return quat_rotate(jnp.asarray(turn), jnp.asarray(array))
    return array
