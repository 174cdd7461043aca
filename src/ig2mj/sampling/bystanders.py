"""Objects that a change to the world must not move, compared with an unchanged copy of the world.

A placement, or the opening of a door, must not push other objects away. Objects that move by themselves (an apple that
still rolls, a cup that a robot carries) do not count. A copy of the world without the change, stepped as often,
distinguishes the two. It is stepped only if something has moved, and all changes tried from one state share its
trajectory.

Axes: O objects, J openable joints, B bodies of agents.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.native.engine import NativePhysics
from ig2mj.engine.snapshot import Snapshot
from ig2mj.sampling.query import SceneQuery

MOVED = 0.01
"""Metres. Nothing else may move farther while a change settles, seen from where it was and from where the copy's is."""

JOINT_MOVED = 0.05
"""Radians or metres. A door or drawer of another object that is moved farther has been shoved."""


@dataclasses.dataclass(frozen=True)
class _Moment:
    """Where everything is: centres of mass (metres, world frame), joints, who is awake, bodies of agents (metres)."""

    com: Float[np.ndarray, "O 3"]
    joints: Float[np.ndarray, "J"]
    awake: Bool[np.ndarray, "O"]
    agents: Float[np.ndarray, "B 3"]


class Bystanders:
    """The objects of a world before a change, and where they would be without it."""

    def __init__(self, query: SceneQuery, start: Snapshot):
        """Binds the present state of the world.

        Args:
          query: the world, before it is changed. start: its state, as `SceneQuery.save` gives it.
        """
        self._query, self._start = query, start
        view = query.view
        self.touching = np.array(view.touching[0])
        """Which objects touch [O, O] before the change."""
        self._at_rest = not query.scene.agents and not np.asarray(view.awake).any()
        self._copy: NativePhysics | None = None
        self._agents = np.flatnonzero(query.scene.tables.body_agent >= 0)
        self._trail = [self._moment(query.physics)]

    def shoved(self) -> Bool[np.ndarray, "O"]:
        """Objects that are elsewhere than before and than the unchanged copy's, by more than `MOVED`."""
        now = np.asarray(self._query.view.object_com[0])
        moved = np.asarray(np.linalg.norm(now - self._trail[0].com, axis=1) > MOVED)
        if moved.any() and not self._at_rest:
            moved &= np.linalg.norm(now - self._unchanged().com, axis=1) > MOVED
        return moved

    def forced(self) -> Bool[np.ndarray, "O"]:
        """Objects whose doors or drawers are elsewhere than before and than the copy's, by more than `JOINT_MOVED`."""
        now = np.asarray(self._query.view.joint_pos[0])
        moved = np.abs(now - self._trail[0].joints) > JOINT_MOVED
        if moved.any() and not self._at_rest:
            moved &= np.abs(now - self._unchanged().joints) > JOINT_MOVED
        tables = self._query.scene.tables
        return np.isin(np.arange(tables.num_objects), tables.openable_object[moved])

    def pushed_agents(self) -> bool:
        """Whether a part of an agent is elsewhere than before and than the copy's, by more than `MOVED`."""
        if not len(self._agents):
            return False
        now = self._positions(self._query.physics)
        moved = np.linalg.norm(now - self._trail[0].agents, axis=1) > MOVED
        return bool(moved.any() and (np.linalg.norm(now - self._unchanged().agents, axis=1)[moved] > MOVED).any())

    def restless(self) -> Bool[np.ndarray, "O"]:
        """Objects that are awake, and asleep in the unchanged copy."""
        awake = np.array(self._query.view.awake[0])
        return awake if self._at_rest or not awake.any() else awake & ~self._unchanged().awake

    def _unchanged(self) -> _Moment:
        """The copy after as many control steps as the world has taken since the start."""
        query = self._query
        seconds = float(query.engine.time(query.physics)[0]) - float(self._start.time)
        step = round(seconds / (query.engine.substeps * query.engine.timestep))
        if self._copy is None:
            self._copy = query.engine.load(query.engine.reset(), self._start)
        while len(self._trail) <= step:
            self._copy, _ = query.engine.step(self._copy)
            self._trail.append(self._moment(self._copy))
        return self._trail[step]

    def _moment(self, physics: NativePhysics) -> _Moment:
        view = self._query.engine.view(physics)
        return _Moment(
            np.array(view.object_com[0]),
            np.array(view.joint_pos[0]),
            np.array(view.awake[0]),
            self._positions(physics),
        )

    def _positions(self, physics: NativePhysics) -> Float[np.ndarray, "B 3"]:
        """Origins of the agents' bodies, metres, world frame."""
        if not len(self._agents):
            return np.zeros((0, 3))
        return np.array(self._query.engine.to_mujoco(physics, 0)[1].xpos[self._agents])
