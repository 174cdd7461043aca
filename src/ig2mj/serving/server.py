"""`serve`: a policy of ig2mj behind a websocket, by openpi's protocol.

The metadata names the task, robot and observations, and says that batches are answered (`"batch": true`). What a policy
remembers belongs to a connection and to the number `world` of an observation, else its place in the batch. An episode
begins with an observation whose `episode_start` is true, and with the first one of a world.
"""

from __future__ import annotations

import http
import threading
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ig2mj.envs.environment import Environment
from ig2mj.errors import Ig2mjError, PolicyServerError
from ig2mj.install_hint import require_extras
from ig2mj.learn.evaluate import draws
from ig2mj.learn.policies import Policy, perception_of
from ig2mj.serving import messages
from ig2mj.serving.observations import BEGINS, PREFIX, WORLD, openpi_name

HOST, PORT = "127.0.0.1", 8000

MOST_BATCH, MOST_WORLDS = 4096, 65_536
"""Observations of a message, and worlds of a connection."""


class ServedPolicy:
    """Answers messages. Attributes: metadata: what a connection gets first."""

    def __init__(self, policy: Policy, env: Environment, file: object, drawn: bool | None = None):
        """`env`: one that the policy is for. `drawn`: actions are sampled; None: as the policy was evaluated.

        Raises PolicyMismatch: the policy is for something else.
        """
        perception = perception_of(policy, env.observation_spaces)
        policy.check(env, perception, file)
        self._spaces = {name: env.observation_spaces[name] for name in policy.observations}
        choose = policy.player(perception, sampled=draws(policy) if drawn is None else drawn)
        parameters = policy.parameters()
        more = () if parameters is None else (parameters,)
        self._choose = jax.jit(lambda obs, kept, begins, keys: choose(obs, kept, begins, keys, *more))
        self._remembers = 0 if policy.memory is None else policy.memory.size
        self._random, self._lock = np.random.default_rng(0), threading.Lock()
        depends = policy.card["depends"]
        self.metadata = {
            "server": "ig2mj",
            "batch": True,
            "task": depends["task"],
            "robot": depends["robot"],
            "grasping": depends["grasping"],
            "relaxed_thresholds": bool(policy.card.get("paper_rl", False)),
            "observations": list(policy.observations),
            "example": {
                openpi_name(name).removeprefix(PREFIX): np.zeros(space.shape, space.dtype)
                for name, space in self._spaces.items()
            },
            "action_names": list(env.action_names),
        }

    def session(self) -> Callable[[Any], Any]:
        """What answers the messages of one connection."""
        kept: dict[int, np.ndarray] = {}

        def answer(message: Any) -> Any:
            if not isinstance(message, dict):
                raise PolicyServerError("an observation is a map")
            batch = message.get("batch")
            if batch is None:
                return {"actions": self._infer([message], kept)[0][None]}
            if not isinstance(batch, list) or not 0 < len(batch) <= MOST_BATCH:
                raise PolicyServerError(f"a batch is a list of 1 to {MOST_BATCH} observations")
            return {"batch": [{"actions": a[None]} for a in self._infer(batch, kept)]}

        return answer

    def _infer(self, batch: list[Any], kept: dict[int, np.ndarray]) -> np.ndarray:
        obs = {name: np.stack([self._checked(one, name) for one in batch]) for name in self._spaces}
        worlds = [_world(one, place) for place, one in enumerate(batch)]
        begins = np.array([w not in kept or bool(one.get(BEGINS, False)) for w, one in zip(worlds, batch, strict=True)])
        nothing = np.zeros(self._remembers, np.float32)
        memory = np.stack([kept.get(world, nothing) for world in worlds])
        with self._lock:
            keys = self._random.integers(0, 2**32, 2, np.uint32)
            action, after = self._choose(obs, memory, begins, keys)
        kept.update(zip(worlds, np.asarray(after), strict=True))
        return np.asarray(action)

    def _checked(self, one: Any, name: str) -> np.ndarray:
        """An observation of the policy's. Raises PolicyServerError: it is missing, or of another shape or type."""
        key, space = openpi_name(name), self._spaces[name]
        if not isinstance(one, dict) or key not in one:
            raise PolicyServerError(f"the observation lacks '{key}'")
        array = np.asarray(one[key])
        expected = f"{np.dtype(space.dtype)}{list(space.shape)}"
        if array.shape != tuple(space.shape) or array.dtype.kind != np.dtype(space.dtype).kind:
            raise PolicyServerError(f"'{key}' is {array.dtype}{list(array.shape)}, and the policy takes {expected}")
        return array.astype(space.dtype)


def _world(one: Any, place: int) -> int:
    """Number of the world that an observation is of. Raises PolicyServerError."""
    world = one.get(WORLD, place)
    if isinstance(world, bool) or not isinstance(world, int) or not 0 <= world < MOST_WORLDS:
        raise PolicyServerError(f"'{WORLD}' is {str(world)[:40]}: a whole number below {MOST_WORLDS}")
    return world


def serve(policy: ServedPolicy, host: str = HOST, port: int = PORT) -> Any:
    """A server that listens; `serve_forever` answers until `shutdown` is called from another thread.

    Raises:
      MissingDependencyError: websockets or msgpack is not installed. Ig2mjError: the port is taken.
    """
    require_extras("serve")
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import serve as listen

    def handle(socket: Any) -> None:
        answer = policy.session()
        try:
            socket.send(messages.pack(policy.metadata))
            for packed in socket:
                try:
                    socket.send(messages.pack(answer(messages.unpack(packed))))
                except Ig2mjError as e:
                    socket.send(str(e))  # text is an error in openpi's protocol
                    socket.close(1011, "see the message before")
                    return
        except ConnectionClosed:
            return

    def health(connection: Any, request: Any) -> Any:
        return connection.respond(http.HTTPStatus.OK, "OK\n") if request.path == "/healthz" else None

    try:
        return listen(handle, host, port, compression=None, max_size=messages.MOST_BYTES, process_request=health)
    except OSError as e:
        raise Ig2mjError(f"cannot listen at {host}:{port}: {e.strerror or e} (take another --port)") from e
