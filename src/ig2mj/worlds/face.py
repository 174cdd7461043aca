"""`Face`: the verbs of a batch of worlds, which all of its faces share.

| verb | what it does |
|---|---|
| `start(seed)` | all worlds at the start of their first episode |
| `step(batch, action)` | one control step of every world |
| `reset(batch, mask)` | a new episode in the masked worlds |
| `rollout(batch, carry, policy, length)` | many steps under a policy |
| `write(batch, write)` | a change that is not simulated |
| `fork(batch)` | an independent copy |
| `save(batch, file)`, `load(file)` | a file of all worlds, and back |
| `metrics(batch)` | counts of episodes and of flagged worlds |

`step`, `reset`, `rollout` and `write` consume the batch: continue with the one that is returned.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import os
from typing import Any

from jaxtyping import Bool, Float

from ig2mj.engine.base import Engine, EngineHolder, Write
from ig2mj.engine.view import Array
from ig2mj.predicates.compile import GoalStatus
from ig2mj.process import entry_point
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.batch_files import load_batch, save_batch
from ig2mj.worlds.core import Core, Policy
from ig2mj.worlds.random_streams import Seeds

VERBS = ("start", "step", "reset", "rollout", "write", "fork", "save", "load", "metrics")


@entry_point
class Face(EngineHolder):
    """A core by its verbs. Attributes: core: what steps the worlds."""

    NO_COPY = (
        "worlds hold their engine, and are neither copied nor pickled: make others, in the process that uses them;"
        " fork(batch) copies a batch, save(batch, FILE) keeps one"
    )

    core: Core

    @property
    def engine(self) -> Engine:
        """The engine that steps physics."""
        return self.core.engine

    def start(self, seed: Seeds = 0) -> Batch:
        """All worlds at the start of their first episode; `seed` of everything random, or [W] of each world."""
        return self.core.start(seed)

    def step(self, batch: Batch, action: Float[Array, "W n"] | None = None) -> tuple[Batch, GoalStatus]:
        """One control step of every world, and the status of the goal; see `Core.step`. Consumes the batch."""
        return self.core.step(batch, action)

    def reset(self, batch: Batch, mask: Bool[Array, "W"]) -> Batch:
        """A new episode in the masked worlds, each from a random row of the pool. Consumes the batch."""
        return self.core.reset(batch, mask)

    def rollout(self, batch: Batch, carry: Any, policy: Policy, length: int) -> tuple[Batch, Any]:
        """`length` control steps under a policy; see `Core.rollout`. Consumes batch and carry."""
        return self.core.rollout(batch, carry, policy, length)

    def write(self, batch: Batch, write: Write) -> Batch:
        """Moves objects and joints, or switches grasps, without passing time. Consumes the batch."""
        return self.core.write(batch, write)

    def fork(self, batch: Batch) -> Batch:
        """An independent copy, for planners and branches; see `Core.fork`."""
        return self.core.fork(batch)

    def save(self, batch: Batch, file: str | os.PathLike) -> None:
        """Writes all worlds to an `.npz` file (arrays only, no pickle), for `load`.

        Raises:
          StaleStateError: the batch was consumed. InputError: the file cannot be written.
        """
        save_batch(self.core, batch, file)

    def load(self, file: str | os.PathLike) -> Batch:
        """The batch that `save` wrote, which continues as it would have; on any machine and engine.

        Raises:
          InputError: the file is missing or damaged, or of another scene, mode of grasping or number of worlds.
        """
        return load_batch(self.core, file)

    def metrics(self, batch: Batch) -> dict[str, int]:
        """Episodes begun, and how often worlds were flagged, by `guards.Flag`. On the host."""
        return self.core.metrics(batch)
