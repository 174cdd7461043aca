"""Joints of a compiled scene that follow others (`FollowingJoints`), such as the segments of a telescope."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import mujoco

from ig2mj.agents.urdf.references import Coupling, couplings_of

SMALL = 1e-4
"""rad or m of a leader, over which the rate of a follower is measured."""


class FollowingJoints:
    """All joints that follow some joints, directly or over others."""

    def __init__(self, model: mujoco.MjModel, leaders: Sequence[str]):
        """leaders: names of hinges and slides of the model."""
        self._found: list[
            tuple[Coupling, int, int, str]
        ] = []  # address and DOF of the follower, the leader that moves it
        self._address = {name: int(model.joint(name).qposadr[0]) for name in leaders}
        first, left, progress = dict(zip(leaders, leaders, strict=True)), couplings_of(model), True
        self._numbers = {name: k for k, name in enumerate(leaders)}
        while progress:
            progress = False
            for coupling in list(left):
                if coupling.leader in first and coupling.follower not in first:
                    joint = model.joint(coupling.follower)
                    self._address[coupling.follower] = int(joint.qposadr[0])
                    first[coupling.follower] = first[coupling.leader]
                    self._found.append((coupling, int(joint.qposadr[0]), int(joint.dofadr[0]), first[coupling.leader]))
                    left.remove(coupling)
                    progress = True

    def put(self, data: Any) -> None:
        """Brings the followers to where the leaders of `data.qpos` put them."""
        for coupling, address, _, _ in self._found:
            assert coupling.leader is not None
            data.qpos[address] = coupling.position(float(data.qpos[self._address[coupling.leader]]))

    def rates(self, data: Any) -> Iterator[tuple[int, int, float]]:
        """Of each follower its degree of freedom, the number of the leader that moves it, and how fast it goes per
        speed of that one."""
        speed: dict[str, float] = {}
        for coupling, _, dof, first in self._found:
            assert coupling.leader is not None
            at = float(data.qpos[self._address[coupling.leader]])
            own = (coupling.position(at + SMALL) - coupling.position(at - SMALL)) / (2 * SMALL)
            speed[coupling.follower] = own * speed.get(coupling.leader, 1.0)
            yield dof, self._numbers[first], speed[coupling.follower]
