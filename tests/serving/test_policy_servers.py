"""Policy servers: messages, connections, and what is refused. Servers are small ones of the tests on loopback."""

from __future__ import annotations

import contextlib
import threading

import numpy as np
import pytest

from ig2mj.errors import InputError, PolicyServerError, UnknownNameError
from ig2mj.serving import messages
from ig2mj.serving.client import Question, connect
from ig2mj.serving.observations import openpi_name, to_groot, to_openpi

OBS = {"proprioception": np.arange(3, dtype=np.float32), "right_wrist/rgb": np.zeros((2, 2, 3), np.uint8)}


@contextlib.contextmanager
def listening(answer, metadata=None):
    """A server of openpi's protocol: `answer` gives the bytes or the text for each message."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import serve

    def handle(socket):
        with contextlib.suppress(ConnectionClosed):
            socket.send(messages.pack(metadata or {}))
            for packed in socket:
                reply = answer(messages.unpack(packed))
                if reply is None:
                    socket.close()
                    return
                socket.send(reply)

    server = serve(handle, "127.0.0.1", 0, compression=None)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
    finally:
        server.shutdown()
        thread.join()


def ask(address, worlds=3, timeout=5.0):
    server = connect(address, worlds, timeout)
    try:
        return server.infer([Question(w, OBS, "do it", True) for w in range(worlds)])
    finally:
        server.close()


@pytest.mark.parametrize("text_keys", [False, True])
def test_arrays_survive_the_way(text_keys):
    sent = {"a": np.arange(6, dtype=np.int16).reshape(2, 3), "b": [np.float32(1.5), "x"]}
    back = messages.unpack(messages.pack(sent, text_keys))
    np.testing.assert_array_equal(back["a"], sent["a"])
    assert back["a"].dtype == np.int16 and back["b"] == [1.5, "x"]
    np.testing.assert_array_equal(messages.unpack_npy(messages.pack_npy(sent))["a"], sent["a"])


@pytest.mark.parametrize(
    "array",
    [
        {b"__ndarray__": True, b"data": b"12", b"dtype": "<f4", b"shape": [1]},
        {b"__ndarray__": True, b"data": b"", b"dtype": "|O", b"shape": [0]},
        {b"__ndarray__": True, b"data": b"1", b"dtype": "|u1", b"shape": [-1]},
        {b"__ndarray__": True},
        {"__ndarray_class__": True, "as_npy": b"no"},
    ],
)
def test_arrays_that_are_none_are_refused(array):
    import msgpack

    read = messages.unpack_npy if "__ndarray_class__" in array else messages.unpack
    with pytest.raises(PolicyServerError):
        read(msgpack.packb({"a": array}))


def test_observations_have_the_names_of_each_form():
    assert openpi_name("rgb") == "observation/image" and openpi_name("room/rgb") == "observation/room_image"
    assert set(to_openpi(OBS, "go")) == {"observation/state", "observation/wrist_image", "prompt"}
    groot = to_groot({name: np.stack([a, a]) for name, a in OBS.items()}, ["go", "on"])
    assert groot["video"]["right_wrist"].shape == (2, 1, 2, 2, 3) and groot["state"]["state"].shape == (2, 1, 3)
    assert groot["language"] == {"task": [["go"], ["on"]]}


def test_worlds_are_asked_for_on_several_connections_and_get_chunks():
    with listening(lambda m: messages.pack({"actions": np.full((5, 2), m["observation/state"][1])})) as address:
        chunks = ask(address)
    assert [c.shape for c in chunks] == [(5, 2)] * 3 and chunks[0][0, 0] == 1


def test_a_server_that_batches_gets_all_worlds_in_one_message():
    seen = []

    def answer(message):
        seen.append([one["world"] for one in message["batch"]])
        return messages.pack({"batch": [{"actions": [float(one["world"])]} for one in message["batch"]]})

    with listening(answer, {"batch": True}) as address:
        assert [c.tolist() for c in ask(address)] == [[[0.0]], [[1.0]], [[2.0]]]
    assert seen == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda m: None, "is gone"),
        (lambda m: "Traceback\nValueError: no such key", "ValueError: no such key"),
        (lambda m: b"\xc1", "no msgpack"),
        (lambda m: messages.pack({"nonsense": 1}), "has no actions"),
        (lambda m: messages.pack({"actions": "left"}), "has no actions"),
    ],
)
def test_a_server_that_dies_or_answers_nonsense_is_reported(answer, words):
    with listening(answer) as address, pytest.raises(PolicyServerError, match=words):
        ask(address, worlds=1)


def test_a_server_that_takes_too_long_is_reported():
    done = threading.Event()
    with listening(lambda m: done.wait(5) or None) as address:
        with pytest.raises(PolicyServerError, match=r"has not answered for 0\.2 s"):
            ask(address, worlds=1, timeout=0.2)
        done.set()


def test_addresses_that_are_none_are_refused():
    with pytest.raises(UnknownNameError, match=r"'wss'.*near matches: ws"):
        connect("wss://localhost:1")
    with pytest.raises(InputError, match="`ig2mj evaluate FILE` takes a policy's file"):
        connect("policy.npz")
    with pytest.raises(InputError, match="no host and port"):
        connect("ws://localhost")
    with pytest.raises(PolicyServerError, match="no policy server answers"):
        connect("ws://127.0.0.1:9", timeout=2.0)
