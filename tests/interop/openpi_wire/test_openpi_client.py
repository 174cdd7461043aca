"""openpi's own client asks a policy that `ig2mj policies serve` serves."""

from __future__ import annotations

import os
import pathlib
import socket
import subprocess

import numpy as np
import pytest
from openpi_client.action_chunk_broker import ActionChunkBroker
from openpi_client.websocket_client_policy import WebsocketClientPolicy

POLICY = "GraspingBook"


@pytest.fixture(scope="module")
def port():
    """Of a server of the shipped policy, in a process of its own."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        number = free.getsockname()[1]
    command = pathlib.Path(os.environ["IG2MJ_PYTHON"]).with_name("ig2mj")
    server = subprocess.Popen([command, "policies", "serve", POLICY, "--port", str(number)], stdout=subprocess.PIPE)
    try:
        assert b"serving" in server.stdout.readline()
        yield number
    finally:
        server.terminate()
        server.wait(30)


def test_openpis_client_gets_actions(port):
    client = WebsocketClientPolicy("127.0.0.1", port)
    says = client.get_server_metadata()
    assert says["task"] == POLICY and {"rgb", "depth"} <= set(says["observations"])
    seen = {f"observation/{name}": value for name, value in says["example"].items()}
    for _ in range(3):
        actions = client.infer({**seen, "prompt": "Take the notebook."})["actions"]
        assert actions.shape == (1, len(says["action_names"])) and np.isfinite(actions).all()
    broker = ActionChunkBroker(client, action_horizon=1)
    assert broker.infer(seen)["actions"].shape == (len(says["action_names"]),)


def test_openpis_client_reports_what_is_wrong_with_an_observation(port):
    client = WebsocketClientPolicy("127.0.0.1", port)
    with pytest.raises(RuntimeError, match="the observation lacks"):
        client.infer({"prompt": "nothing"})
