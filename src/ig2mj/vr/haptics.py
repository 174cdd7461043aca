"""What hands feel: a strong pulse in both while the body touches walls, a light one in a hand that touches or holds
something (iGibson's VR interface: 0.9 and 0.3)."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import PhysicsView
from ig2mj.scene.scene import Scene

WALL_PULSE, HAND_PULSE = 0.9, 0.3
"""Strengths, 0..1."""

WALLS = "walls"
"""Category of what the body must not run into."""


class Touch:
    """Pulses of the hands of a scene's first agent, from the contacts of one world."""

    def __init__(self, scene: Scene):
        """Finds out which geoms are of the agent's body, of each hand, and of walls."""
        model, tables = scene.model, scene.tables
        root = np.asarray(model.body_rootid)[np.asarray(model.geom_bodyid)]
        self._body = root == tables.agent_body[0]
        hands = np.flatnonzero(np.asarray(tables.hand_agent) == 0)
        self._palms = [int(b) for b in np.asarray(tables.hand_body)[hands]]
        self._hand = np.full(model.ngeom, -1)
        for k, palm in enumerate(self._palms):
            self._hand[root == palm] = k
        self._hands = hands
        categories = [entry.category for entry in scene.manifest.objects]
        owner = np.asarray(tables.geom_object)
        walls = np.array([c == WALLS for c in categories])
        self._wall = np.where(owner >= 0, walls[np.maximum(owner, 0)], False)

    def __call__(self, data: mujoco.MjData, view: PhysicsView) -> Float[np.ndarray, "2"]:
        """Strength of the pulse of the left and of the right hand, 0..1."""
        pulses = np.where(np.asarray(view.held)[0][self._hands].any(-1), HAND_PULSE, 0.0)
        if data.ncon:
            pairs = np.asarray(data.contact.geom)[np.asarray(data.contact.dist) <= 0.0]
            for k in range(len(pulses)):
                if self._meet(pairs, self._hand == k):
                    pulses[k] = HAND_PULSE
            if self._meet(pairs, self._body, self._wall):
                pulses[:] = WALL_PULSE
        return pulses

    @staticmethod
    def _meet(pairs: np.ndarray, one: Bool[np.ndarray, "G"], other: Bool[np.ndarray, "G"] | None = None) -> bool:
        """Whether a contact is between geoms of `one` and of `other`, or of anything else."""
        a, b = one[pairs[:, 0]], one[pairs[:, 1]]
        if other is None:
            return bool((a != b).any())
        return bool(((a & other[pairs[:, 1]]) | (b & other[pairs[:, 0]])).any())
