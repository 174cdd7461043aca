"""`connect`: a client of policy servers, which answer observations of many worlds with chunks of actions.

    server = connect("ws://localhost:8000")
    chunks = server.infer([Question(world, obs, instruction, begins), ...])      # [T, n] of each

| address | protocol |
|---|---|
| `ws://HOST:PORT` | openpi's |
| `vla-eval://HOST:PORT` | vla-eval's, over a websocket |
| `groot://HOST:PORT` | GR00T's, over ZeroMQ (needs pyzmq) |

A server of openpi's protocol whose metadata has `"batch": true` gets `{"batch": [...]}` with the observations of all
worlds and answers in the same form. Other servers get one message at a time on each of several connections.
"""

from __future__ import annotations

import concurrent.futures
import dataclasses
import time
import urllib.parse
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from ig2mj.errors import InputError, PolicyServerError, UnknownNameError
from ig2mj.install_hint import require_extras, require_module
from ig2mj.serving import messages
from ig2mj.serving.observations import BEGINS, WORLD, to_groot, to_openpi, to_vla_eval

CONNECTIONS = 64
"""To a server that answers one observation at a time."""

TIMEOUT = 60.0
"""s that an answer may take."""

Obs = Mapping[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Question:
    """An observation of one world. Attributes: world: its number. begins: an episode begins with the observation."""

    world: int
    obs: Obs
    instruction: str
    begins: bool


class PolicyServer(Protocol):
    """A connected server. Attributes: metadata: what it says of itself."""

    metadata: dict[str, Any]

    def infer(self, questions: Sequence[Question]) -> list[np.ndarray]:
        """Chunks of actions [T, n], one for each question. Raises PolicyServerError."""
        ...

    def close(self) -> None:
        """Closes all connections."""
        ...


def connect(address: str, worlds: int = 1, timeout: float = TIMEOUT) -> PolicyServer:
    """Connects to a policy server.

    Args:
      address: see the module's text. worlds: that are asked for at once, at most. timeout: s for each answer.

    Raises:
      UnknownNameError: no such protocol. InputError: no address. MissingDependencyError: a package is missing.
      PolicyServerError: no server answers there.
    """
    if "://" not in address:
        fix = "write ws://HOST:PORT; `ig2mj evaluate FILE` takes a policy's file"
        raise InputError(address, "is no address of a policy server", fix=fix)
    parsed = urllib.parse.urlsplit(address)
    if parsed.scheme not in PROTOCOLS:
        raise UnknownNameError("protocol of policy servers", parsed.scheme, PROTOCOLS)
    try:
        host, port = parsed.hostname, parsed.port
    except ValueError as e:
        raise InputError(address, str(e), fix="write HOST:PORT") from e
    if not host or not port:
        raise InputError(address, "names no host and port", fix="write ws://localhost:8000")
    require_extras("serve")
    return PROTOCOLS[parsed.scheme](host, port, worlds, timeout)


class _Socket:
    """A websocket whose messages are bytes."""

    def __init__(self, host: str, port: int, timeout: float):
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect as open_socket

        self._at, self._timeout, self._errors = f"ws://{host}:{port}", timeout, (WebSocketException, OSError)
        try:
            self._socket = open_socket(
                f"ws://{host}:{port}",
                compression=None,
                max_size=messages.MOST_BYTES,
                open_timeout=timeout,
                ping_interval=None,  # a server may be busy for long
            )
        except (*self._errors, TimeoutError) as e:
            fix = "start one, such as `ig2mj policies serve NAME --port PORT`"
            raise PolicyServerError(f"no policy server answers at {self._at}: {e or type(e).__name__} ({fix})") from e

    def send(self, packed: bytes) -> None:
        """Sends a message. Raises PolicyServerError."""
        try:
            self._socket.send(packed)
        except self._errors as e:
            raise PolicyServerError(f"the policy server at {self._at} is gone: {e}") from e

    def receive(self) -> Any:
        """The next message, unpacked. Raises PolicyServerError."""
        try:
            answer = self._socket.recv(self._timeout)
        except TimeoutError as e:
            message = f"the policy server at {self._at} has not answered for {self._timeout:g} s"
            raise PolicyServerError(message) from e
        except self._errors as e:
            raise PolicyServerError(f"the policy server at {self._at} is gone: {e}") from e
        try:
            return messages.unpack(answer)
        except PolicyServerError as e:
            raise PolicyServerError(f"the policy server at {self._at}: {e}") from e

    def close(self) -> None:
        self._socket.close()


class _Pool:
    """Several connections, each of which serves some worlds one after the other."""

    def __init__(self, make: Callable[[], Any], worlds: int):
        self.sockets = [make() for _ in range(max(1, min(worlds, CONNECTIONS)))]
        self._threads = concurrent.futures.ThreadPoolExecutor(len(self.sockets))

    def each(self, ask: Callable[[Any, Question], np.ndarray], questions: Sequence[Question]) -> list[np.ndarray]:
        """What `ask` gives for each question. A world always has the same connection."""
        count = len(self.sockets)
        shares = [[k for k, q in enumerate(questions) if q.world % count == place] for place in range(count)]
        asked = [
            (share, self._threads.submit(lambda s=socket, share=share: [ask(s, questions[k]) for k in share]))
            for socket, share in zip(self.sockets, shares, strict=True)
        ]
        found = {k: answer for share, future in asked for k, answer in zip(share, future.result(), strict=True)}
        return [found[k] for k in range(len(questions))]

    def close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for socket in self.sockets:
            socket.close()


class OpenpiServer:
    """openpi's protocol: the server first sends its metadata; an observation is answered with a map with "actions"."""

    def __init__(self, host: str, port: int, worlds: int, timeout: float):
        first = _Socket(host, port, timeout)
        metadata = first.receive()
        if not isinstance(metadata, dict):
            raise PolicyServerError(f"ws://{host}:{port} sends no metadata first: it is no server of openpi's protocol")
        self.metadata = {str(name): value for name, value in metadata.items()}
        self._batch = self.metadata.get("batch") is True
        sockets = [first]

        def another() -> _Socket:
            if sockets:
                return sockets.pop()
            socket = _Socket(host, port, timeout)
            socket.receive()
            return socket

        self._pool = _Pool(another, 1 if self._batch else worlds)

    def infer(self, questions: Sequence[Question]) -> list[np.ndarray]:
        if not self._batch:
            return self._pool.each(self._one, questions)
        sent = [self._message(question) for question in questions]
        socket = self._pool.sockets[0]
        socket.send(messages.pack({"batch": sent}))
        answer = socket.receive()
        answers = answer.get("batch") if isinstance(answer, dict) else None
        if not isinstance(answers, list) or len(answers) != len(sent):
            raise PolicyServerError(f"the policy server answers a batch of {len(sent)} with {_words(answer)}")
        return [_actions(one) for one in answers]

    def _message(self, question: Question) -> dict[str, Any]:
        message = to_openpi(question.obs, question.instruction)
        return message | {BEGINS: question.begins, WORLD: question.world} if self._batch else message

    def _one(self, socket: _Socket, question: Question) -> np.ndarray:
        socket.send(messages.pack(self._message(question)))
        return _actions(socket.receive())

    def close(self) -> None:
        self._pool.close()


class VlaEvalServer:
    """vla-eval's protocol: messages in envelopes; the beginnings of episodes are messages of their own."""

    def __init__(self, host: str, port: int, worlds: int, timeout: float):
        self.metadata: dict[str, Any] = {}
        self._sequence = 0
        self._pool = _Pool(lambda: _Socket(host, port, timeout), worlds)
        for socket in self._pool.sockets:
            self._send(socket, "hello", {"client": "ig2mj"})
            reply = socket.receive()
            if isinstance(reply, dict) and reply.get("type") == "hello" and isinstance(reply.get("payload"), dict):
                self.metadata = reply["payload"]

    def _send(self, socket: _Socket, kind: str, payload: Mapping[str, Any]) -> None:
        self._sequence += 1
        envelope = {"type": kind, "payload": payload, "seq": self._sequence, "timestamp": time.time()}
        socket.send(messages.pack(envelope, text_keys=True))

    def infer(self, questions: Sequence[Question]) -> list[np.ndarray]:
        return self._pool.each(self._one, questions)

    def _one(self, socket: _Socket, question: Question) -> np.ndarray:
        if question.begins:
            self._send(socket, "episode_start", {"task_description": question.instruction})
        self._send(socket, "observation", to_vla_eval(question.obs, question.instruction))
        answer = socket.receive()
        payload = answer.get("payload") if isinstance(answer, dict) else None
        if not isinstance(payload, dict) or answer.get("type") != "action":
            raise PolicyServerError(f"the policy server answers an observation with {_words(answer)}")
        return _actions(payload)

    def close(self) -> None:
        self._pool.close()


class GrootServer:
    """GR00T's protocol: `get_action` with the observations of all worlds; a map of chunks [W, T, d], in its order."""

    def __init__(self, host: str, port: int, worlds: int, timeout: float):
        require_module("zmq")
        import zmq  # pyright: ignore[reportMissingImports]

        self._zmq, self._at = zmq, f"tcp://{host}:{port}"
        self._socket = zmq.Context.instance().socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.RCVTIMEO, int(timeout * 1000))
        self._socket.setsockopt(zmq.SNDTIMEO, int(timeout * 1000))
        self._socket.connect(self._at)
        self.metadata = {"batch": True}
        self._ask("ping", None)

    def _ask(self, endpoint: str, data: Any) -> Any:
        try:
            self._socket.send(messages.pack_npy({"endpoint": endpoint, **({} if data is None else {"data": data})}))
            answer = messages.unpack_npy(self._socket.recv())
        except self._zmq.ZMQError as e:
            raise PolicyServerError(f"the policy server at {self._at} does not answer: {e}") from e
        if isinstance(answer, dict) and "error" in answer:
            raise PolicyServerError(f"the policy server at {self._at} reports: {str(answer['error'])[:300]}")
        return answer

    def infer(self, questions: Sequence[Question]) -> list[np.ndarray]:
        obs = {name: np.stack([q.obs[name] for q in questions]) for name in questions[0].obs}
        sent = to_groot(obs, [q.instruction for q in questions])
        answer = self._ask("get_action", {"observation": sent, "options": None})
        parts = answer[0] if isinstance(answer, list | tuple) and answer else answer
        if not isinstance(parts, dict) or not parts:
            raise PolicyServerError(f"the policy server answers get_action with {_words(answer)}")
        arrays = [np.asarray(part) for part in parts.values()]
        if any(a.dtype.kind not in messages.KINDS or a.ndim not in (2, 3) or len(a) != len(questions) for a in arrays):
            words = f"get_action for {len(questions)} worlds with {_words(parts)}"
            raise PolicyServerError(f"the policy server answers {words}")
        chunks = np.concatenate([a if a.ndim == 3 else a[..., None] for a in arrays], axis=2)
        return list(chunks.astype(np.float32))

    def close(self) -> None:
        self._socket.close()


PROTOCOLS: dict[str, Callable[[str, int, int, float], PolicyServer]] = {
    "ws": OpenpiServer,
    "vla-eval": VlaEvalServer,
    "groot": GrootServer,
}


def _actions(answer: Any) -> np.ndarray:
    """[T, n]. Raises PolicyServerError: the answer has none."""
    found = next((answer[k] for k in ("actions", "action") if k in answer), None) if isinstance(answer, dict) else None
    try:
        array = np.asarray(found, np.float32)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if found is None or array.ndim not in (1, 2) or not array.size:
        raise PolicyServerError(f"the policy server answers an observation with {_words(answer)}, which has no actions")
    return np.atleast_2d(array)


def _words(answer: Any) -> str:
    if isinstance(answer, dict):
        return f"a map of {', '.join(repr(k) for k in list(answer)[:8]) or 'nothing'}"
    return f"{type(answer).__name__} {str(answer)[:60]!r}"
