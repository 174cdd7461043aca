"""`RemoteActor`: a policy server as the agent of an environment.

Axes: W worlds, n numbers of an action, T steps of a chunk.
"""

from __future__ import annotations

import collections

import numpy as np
from jaxtyping import Float

from ig2mj.envs.actor import begins
from ig2mj.envs.environment import Environment
from ig2mj.envs.state import EnvState
from ig2mj.errors import PolicyServerError
from ig2mj.serving.client import PolicyServer, Question


class RemoteActor:
    """An `ig2mj.envs.rollout.Act`. A chunk of actions is carried out before the server is asked again."""

    def __init__(self, env: Environment, server: PolicyServer, most_steps: int = 0):
        """`most_steps`: of each chunk that are carried out; 0: all."""
        self._env, self._server, self._most = env, server, most_steps
        self._waiting = [collections.deque[np.ndarray]() for _ in range(env.num_worlds)]

    def __call__(self, state: EnvState) -> Float[np.ndarray, "W n"]:
        """Actions of all worlds; zeros where the episode is over.

        Raises PolicyServerError: the server is gone, too slow, or answers with something other than actions.
        """
        start, over = np.asarray(begins(state)), np.asarray(state.done)
        size = self._env.action_space.shape[0]
        for world in np.flatnonzero(start):
            self._waiting[world].clear()
        asked = [w for w in range(self._env.num_worlds) if not self._waiting[w] and not over[w]]
        if asked:
            obs = {name: np.asarray(a) for name, a in state.obs.items()}
            texts = self._env.instruction(state)
            questions = [Question(w, {n: a[w] for n, a in obs.items()}, texts[w], bool(start[w])) for w in asked]
            chunks = self._server.infer(questions)
            for world, chunk in zip(asked, chunks, strict=True):
                self._take(world, chunk, size)
        return np.stack([w.popleft() if w else np.zeros(size, np.float32) for w in self._waiting])

    def _take(self, world: int, chunk: np.ndarray, size: int) -> None:
        if chunk.shape[1] != size:
            name = self._env.task.name
            problem = f"gives actions of {chunk.shape[1]} numbers; {name} with {self._env.robot} takes {size}"
            raise PolicyServerError(f"the policy server {problem}")
        if not np.isfinite(chunk).all():
            raise PolicyServerError("the policy server gives actions that are not finite")
        self._waiting[world].extend(chunk[: self._most or len(chunk)].astype(np.float32))
