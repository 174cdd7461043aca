"""What a page gets: geometry once, then poses; and what strangers get."""

from __future__ import annotations

import json
import struct
import threading
import types

import mujoco
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.errors import MissingDependencyError
from ig2mj.looks import visual_of
from ig2mj.sensors.tints import TINTS
from ig2mj.vr import server
from ig2mj.vr.frames import PoseFrame
from ig2mj.vr.glb import decorated_glb, scene_glb
from ig2mj.vr.looks import Looks
from ig2mj.vr.mapping import Memory
from ig2mj.vr.page_source import PagePoses
from ig2mj.vr.session import Session
from ig2mj.vr.timing import Timing
from ig2mj.vr.track import PoseTrack
from ig2mj.web.access import access_for

TOKEN = "a-token-of-this-test"


@pytest.fixture(scope="module")
def scene(tiny_home_folder):
    return ig2mj.load_scene(tiny_home_folder, agents=[Humanoid()])


@pytest.fixture
def session(scene):
    """What of a session the page is told of, standing still."""
    task = types.SimpleNamespace(name="Standing", summary="Nothing is to be done.")
    track, data = PoseTrack(), scene.start_data()
    mujoco.mj_forward(scene.model, data)
    track.add(data.xpos.astype(np.float32), data.xquat.astype(np.float32))
    tint, goal = np.full(len(scene.object_names), -1), (("(cooked apple)", False),)
    session = Session.__new__(Session)
    session.env = types.SimpleNamespace(scene=scene, task=task)
    session.looks = Looks(np.zeros((1, 15), np.float32), tint, goal, False, 1.0)
    session.track, session.timing, session.memory = track, Timing(), Memory()
    return session


@pytest.fixture
def page(session, monkeypatch):
    monkeypatch.setattr(server, "check_page", lambda: None)
    with server.HomePage(session, PagePoses(), access_for(None, 0)) as page:
        yield page


def address(page) -> str:
    return f"ws://127.0.0.1:{page.server.port}/"


def until(true) -> None:
    waiting = threading.Event()
    for _ in range(1000):
        if true():
            return
        waiting.wait(0.01)
    raise AssertionError("that never came")


def nodes_of(file: bytes) -> dict:
    magic, version, length = struct.unpack("<4sII", file[:12])
    assert (magic, version, length) == (b"glTF", 2, len(file))
    size = struct.unpack("<I", file[12:16])[0]
    return json.loads(file[20 : 20 + size])


def test_geometry_has_a_node_for_each_body_and_all_that_can_be_seen(scene):
    found = nodes_of(scene_glb(scene.model, np.asarray(scene.tables.geom_object)))
    bodies = [found["nodes"][k]["name"] for k in found["scenes"][0]["nodes"]]
    assert bodies == [f"body_{b}" for b in range(scene.model.nbody)]
    drawn = {node["extras"]["geom"]: node for node in found["nodes"] if "mesh" in node}
    assert set(drawn) == set(np.flatnonzero(scene.model.geom_group < 3).tolist())
    for geom, node in drawn.items():
        (primitive,) = found["meshes"][node["mesh"]]["primitives"]
        place = found["accessors"][primitive["attributes"]["POSITION"]]
        low, high = np.array(place["min"]), np.array(place["max"])
        half = scene.model.geom_aabb[geom, 3:]
        assert (high - low) / 2 == pytest.approx(half, abs=0.02 * half.max()), geom
        assert (high + low) / 2 == pytest.approx(scene.model.geom_aabb[geom, :3], abs=0.02 * half.max())


def test_pages_show_what_looks_add_on_bodies_that_they_know(scene):
    found, visual = nodes_of(decorated_glb(scene)), visual_of(scene)
    assert len(found["scenes"][0]["nodes"]) == scene.model.nbody
    drawn = {node["extras"]["geom"] for node in found["nodes"] if "mesh" in node}
    worn = set(visual.followers.riders)
    assert worn and worn <= drawn and len(worn) < len(visual.followers)
    assert not drawn & (set(visual.followers.geoms.tolist()) - worn), "arms follow two bodies"


def test_a_page_is_welcomed_gets_all_poses_once_and_drives(page, session):
    with connect(address(page)) as socket:
        welcome = json.loads(socket.recv())
        assert welcome["bodies"] == session.env.scene.model.nbody and len(welcome["tints"]) == len(TINTS)
        first = np.frombuffer(socket.recv(), "<f4")
        assert first[0] == welcome["bodies"]
        looks = json.loads(socket.recv())
        assert looks["goal"] == [["(cooked apple)", False]] and looks["timing"] == {}
        again = np.frombuffer(socket.recv(), "<f4")
        assert again[0] == 0  # nothing moved
        socket.send(json.dumps({"type": "desktop", "down": [], "move": [0, 0]}))
        until(lambda: isinstance(page.source.poll(), PoseFrame))
        with connect(address(page)) as other:  # looks through the first one's eyes
            other.recv()
            other.send(json.dumps({"type": "desktop", "down": ["w"], "move": [0, 0]}))
            assert np.frombuffer(other.recv(), "<f4")[5] == 1
    until(lambda: page.source.poll() is None)


def test_when_the_first_page_goes_the_next_one_drives(page):
    first, second = connect(address(page)), connect(address(page))
    first.recv(), second.recv()
    first.close()
    until(lambda: len(page._pages) == 1)
    second.send(json.dumps({"type": "desktop", "down": [], "move": [0, 0]}))
    until(lambda: page.source.poll() is not None)
    second.close()


@pytest.mark.parametrize("message", [b"\x00" * 10, "{", "x" * 100_000, '{"type": "devices", "time": 0}'])
def test_a_page_that_sends_something_else_is_closed_and_the_next_one_welcome(page, message):
    with connect(address(page)) as socket:
        socket.send(message)
        with pytest.raises(ConnectionClosed):
            for _ in range(1000):
                socket.recv(timeout=10)
    until(lambda: page._pages == [])
    with connect(address(page)) as socket:
        assert json.loads(socket.recv())["type"] == "welcome"


def test_without_the_token_nothing_is_told(session, monkeypatch):
    monkeypatch.setattr(server, "check_page", lambda: None)
    with server.HomePage(session, PagePoses(), access_for("127.0.0.1", 0, TOKEN)) as page:
        for path in ("", "?token=another-token-of-this-test", "scene.glb"):
            with pytest.raises(InvalidStatus) as refused:
                connect(f"{address(page)}{path}")
            assert refused.value.response.status_code == 401
        assert page._pages == []


def test_without_three_js_the_command_that_fetches_it_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(server, "PAGE", tmp_path)
    with pytest.raises(MissingDependencyError, match="make web"):
        server.check_page()
