"""Doors, drawers and lids in other positions: objects that rest on them move along, and no other object may be moved.

The checks are those of a placement (`ig2mj.sampling.placement`): motion that the change does not cause is ignored,
everything comes to rest, and no penetration grows.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Write
from ig2mj.engine.view import PhysicsView
from ig2mj.engine.writes import joints, teleports
from ig2mj.sampling.bystanders import MOVED, Bystanders
from ig2mj.sampling.placement import RESTING_PENETRATION
from ig2mj.sampling.query import SceneQuery

DEEPER = 0.001
"""Metres by which the object whose joints were moved may stand deeper in others than before, where that is more than
`RESTING_PENETRATION`."""


@dataclasses.dataclass(frozen=True)
class JointMove:
    """A change of openable joints.

    Attributes:
      object_index: whose joints they are. positions, moves: of all openable joints, with a world axis of 1.
      write: puts them there, with what rests on the links that move. along: objects that go along.
    """

    object_index: int
    positions: Float[np.ndarray, "1 J"]
    moves: Bool[np.ndarray, "1 J"]
    write: Write
    along: Int[np.ndarray, "K"]


class JointMover:
    """Moves openable joints of one object in a `SceneQuery`'s world, and says what is wrong with it.

    Every move starts from the same state: that of the world when this was made.
    """

    def __init__(self, query: SceneQuery, object_index: int):
        """Binds the present state of the world."""
        self.query, self.object_index = query, object_index
        self.before = query.save()
        self._others = Bystanders(query, self.before)
        self._deep = float(query.penetrations()[object_index])

    def plan(self, positions: Float[np.ndarray, "1 J"], moves: Bool[np.ndarray, "1 J"]) -> JointMove:
        """A change of joints: positions in the order of `SceneTables.openable_*`, and which move."""
        tables, width = self.query.scene.tables, self.query.scene.model.nq
        write = joints(width, tables.openable_qposadr, positions[0], moves[0])
        along, pos, quat = self.query.carried(np.asarray(write.qpos_mask)[0], np.asarray(write.qpos)[0])
        if len(along):
            carried = teleports(tables.num_objects, along, pos, quat)
            write = dataclasses.replace(carried, qpos_mask=write.qpos_mask, qpos=write.qpos)
        return JointMove(self.object_index, positions, moves, write, along)

    def shoved_by(self, move: JointMove) -> list[str]:
        """Makes the move and lets the world settle; names of what it shoves, "an agent" among them; none: nothing."""
        query, names = self.query, self.query.scene.object_names
        query.write(move.write)
        exempt = np.isin(np.arange(len(names)), [self.object_index, *move.along])
        start = np.array(query.view.object_com[0, move.along])

        def shoved(view: PhysicsView) -> list[str]:
            found = (self._others.shoved() | self._others.forced()) & ~exempt
            found[move.along] |= np.linalg.norm(np.asarray(view.object_com[0, move.along]) - start, axis=1) > MOVED
            said = [names[o] for o in np.flatnonzero(found)]
            return [*said, "an agent"] if self._others.pushed_agents() else said

        query.settle(stop=lambda view: bool(shoved(view)))
        return shoved(query.view)

    def problem(self, move: JointMove) -> str:
        """Makes the move and lets the world settle; the reason why the result is no good, or ''."""
        if self.shoved_by(move):
            return "moves others"
        awake = np.asarray(self.query.view.awake[0])
        if awake[[self.object_index, *move.along]].any() or self._others.restless().any():
            return "joints do not rest"
        deep = float(self.query.penetrations()[self.object_index])
        if deep > max(RESTING_PENETRATION, self._deep + DEEPER):
            return "stands in something"
        return ""
