"""The viewer in the browser, seen by a page without a browser."""

from __future__ import annotations

import dataclasses
import http.client
import queue
import random
import time

import numpy as np
import pytest

pytest.importorskip("viser")

import msgspec
from web_page import Page
from websockets.exceptions import ConnectionClosed, InvalidStatus

from ig2mj.engine.registry import make_engine
from ig2mj.viewer.state_effects import effects
from ig2mj.viewer.state_marks import tint_of_objects
from ig2mj.web.access import access_for
from ig2mj.web.sources import Home
from ig2mj.web.viewer import WebViewer
from ig2mj.web.viser_server import check_message, start_viser, stop_viser
from ig2mj.worlds.core import Core
from ig2mj.worlds.rules import Rules

GOAL = "(and (on_top box table) (not (open cabinet)))"
TOKEN = "a-token-of-twenty-letters"


def home(scene, worlds: int = 1) -> Home:
    rules = Rules.of_scene(scene)
    return Home(scene, Core(make_engine("native", scene, worlds, threads=1), rules), rules.compiled(GOAL))


@pytest.fixture(scope="module")
def viewer(tiny_home):
    with WebViewer(home(tiny_home, 2), access_for(None, 0)) as made:
        yield made


@pytest.fixture
def page(viewer):
    with Page(viewer.port) as opened:
        assert opened.receive(lambda: "The goal" in opened.texts())
        yield opened


def root(viewer, name: str) -> int:
    scene = viewer.runner.source.scene
    return int(scene.tables.object_root[scene.object_index(name)])


def test_a_page_gets_the_home_as_it_looks_and_the_panel(viewer, page):
    for name in ("box", "table", "apple"):
        assert f"/b{root(viewer, name)}" in page.nodes
    assert "The goal holds" in page.texts() or "does not hold" in page.texts()
    assert "(on_top box table)" in page.texts()


def test_time_passes_until_someone_pauses_it_and_a_step_is_one_step(viewer, page):
    runner = viewer.runner
    page.set("Time", "Pause")
    assert page.receive(lambda: not runner.playing)
    before = runner.steps
    page.set("Time", "Step")
    assert page.receive(lambda: runner.steps == before + 1)
    page.set("Time", "Play")
    assert page.receive(lambda: runner.steps > before + 3)
    page.set("Time", "Pause")
    page.set("Time", "Reset")
    assert page.receive(lambda: viewer._last.time == 0 and viewer._last.jump)
    page.set("Time", "Play")


def test_another_world_of_the_batch_is_shown(viewer, page):
    page.set("World", 1)
    assert page.receive(lambda: viewer.runner.world == 1)
    page.set("World", 0)
    assert page.receive(lambda: viewer.runner.world == 0)
    page.set("World", 99.0)
    assert page.receive(lambda: viewer.runner.world == 1)  # the last that there is
    page.set("World", 0)
    assert page.receive(lambda: viewer.runner.world == 0)


def test_a_click_lists_the_states_of_the_object(viewer, page):
    body = root(viewer, "apple")
    ray = {"ray_origin": (0.0, 0.0, 2.0), "ray_direction": (0.0, 0.0, -1.0), "screen_pos": (0.5, 0.5)}
    page.send("SceneNodeClickMessage", name=f"/b{body}", instance_index=None, modifier=None, **ray)
    assert page.receive(lambda: "<b>apple</b>" in page.texts())
    assert "temperature" in page.texts() and "cooked" in page.texts()


def test_steam_is_shown_while_something_is_hot(viewer, page):
    model, states = viewer.runner.source.model, viewer._last.states
    hot = np.array(states.temperature)
    hot[:, viewer.runner.source.scene.object_index("apple")] = 68.0
    shot = dataclasses.replace(viewer._last, states=states.replace(temperature=hot))
    viewer._tint = tint_of_objects(model, shot.states, shot.row)
    found = effects(model, shot.states, shot.view, shot.row, tint=viewer._tint)
    viewer.stage.mark(found)
    assert page.receive(lambda: "/effects/balls" in page.nodes) and len(found) > 5
    viewer.stage.mark([])
    assert page.receive(lambda: "/effects/balls" not in page.nodes)


def test_an_object_is_dragged_by_a_spring_and_only_what_moves_is_sent(viewer, page):
    body = root(viewer, "box")
    start = np.asarray(viewer._last.body_pos[body])
    page.receive(timeout=0.5)
    page.positions.clear()
    drag = {"name": f"/b{body}", "instance_index": None, "start_position": tuple(map(float, start))}
    drag |= {"start_screen_pos": (0.5, 0.5), "end_screen_pos": (0.5, 0.4), "button": "left", "modifier": None}
    goal = tuple(float(v) for v in start + np.array([0.0, 0.0, 0.4]))
    for phase in ("start", "update"):
        page.send("SceneNodeDragMessage", phase=phase, end_position=goal, **drag)
    assert page.receive(lambda: page.positions.get(f"/b{body}", start)[2] > start[2] + 0.3)
    assert set(page.positions) == {f"/b{body}"}
    page.send("SceneNodeDragMessage", phase="end", end_position=goal, **drag)
    assert page.receive(lambda: not viewer.runner.drags)
    assert page.receive(lambda: page.positions[f"/b{body}"][2] < start[2] + 0.2)


def test_who_vanishes_while_dragging_lets_go(viewer):
    body = root(viewer, "box")
    at = tuple(float(v) for v in viewer._last.body_pos[body])
    with Page(viewer.port) as leaving:
        assert leaving.receive(lambda: f"/b{body}" in leaving.nodes)
        fields = {"name": f"/b{body}", "instance_index": None, "start_position": at, "end_position": at}
        fields |= {"start_screen_pos": (0.5, 0.5), "end_screen_pos": (0.5, 0.4), "button": "left", "modifier": None}
        leaving.send("SceneNodeDragMessage", phase="start", **fields)
        assert leaving.receive(lambda: bool(viewer.runner.drags))
    end = time.monotonic() + 10
    while viewer.runner.drags and time.monotonic() < end:
        viewer._stopped.wait(0.02)
    assert not viewer.runner.drags
    forces = queue.Queue()  # filled by the thread that steps: a state is stale for others as soon as it steps
    viewer.runner._commands.put(lambda: forces.put(viewer.runner.source.mujoco(0)[1].xfrc_applied.copy()))
    assert not np.any(forces.get(timeout=10))


def test_physics_does_not_wait_for_a_page_that_takes_nothing(viewer):
    with Page(viewer.port):  # and never receives
        before = viewer.runner.steps
        end = time.monotonic() + 10
        while viewer.runner.steps < before + 30 and time.monotonic() < end:
            viewer._stopped.wait(0.05)
        assert viewer.runner.steps >= before + 30


def _bad_messages() -> list[bytes | str]:
    encode = msgspec.msgpack.encode
    camera = {"type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, 0]}
    return [
        b"",
        b"\xc1",
        "text",
        encode([1, 2, 3]),
        encode({"kind": "x"}),
        encode({"type": 7}),
        encode({"type": "NoSuchMessage"}),
        encode({"type": "FileTransferStartUpload", "source_component_uuid": "x", "transfer_uuid": "y"}),
        encode({"type": "RunJavascriptMessage", "source": "1"}),
        encode({"type": "GuiUpdateMessage", "uuid": [1], "updates": {"value": 1}}),
        encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"label": "mine"}}),
        encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": float("nan")}}),
        encode({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": "x" * 2000}}),
        encode({**camera}),
        encode({**camera, "fov": "wide"}),
        encode({"type": "SceneNodeClickMessage", "name": {"a": {"b": {"c": {"d": {"e": 1}}}}}}),
        encode({"type": "SceneNodeDragMessage", "name": "/b1", "start_position": [1e300, 0, 0]}),
        b"\x91" * 60_000,
        b"\x00" * 70_000,
        encode({"type": "x" * 10_000}),
    ]


@pytest.mark.parametrize("message", [m for m in _bad_messages() if len(m) < 65536], ids=lambda m: f"{len(m)} bytes")
def test_a_message_that_no_page_sends_is_recognised(message):
    with pytest.raises(ValueError):
        check_message(message)


def test_an_element_takes_only_values_of_its_own_kind():
    def update(value) -> bytes:
        return msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": value}})

    for old, good, bad in ((1.5, 2, "2"), (True, False, 1), ("a", "b", 1), ((0.0, 1.0), [1, 2], [1])):
        assert check_message(update(good), {"u": old}.get)
        with pytest.raises(ValueError):
            check_message(update(bad), {"u": old}.get)
    assert check_message(update(1), {}.get) is False  # an element that is gone: dropped


def test_a_page_cannot_publish_the_server_to_others():
    assert check_message(msgspec.msgpack.encode({"type": "ShareUrlRequest"})) is False


@pytest.mark.parametrize("count", [60, pytest.param(1000, marks=pytest.mark.slow)])
def test_bad_messages_leave_simulation_and_other_pages_unharmed(viewer, page, count):
    bad, rng = _bad_messages(), random.Random(0)
    before, refused = viewer.runner.steps, viewer.gate.refused
    for k in range(count):
        message = bad[k % len(bad)] if k % 2 else rng.randbytes(rng.randrange(1, 300))
        with pytest.raises(ConnectionClosed), Page(viewer.port) as stranger:
            stranger.send_raw(message)
            stranger.receive(timeout=10)
        if k % 50 == 0:
            page.receive(timeout=0.01)
    assert viewer.gate.refused >= refused + 0.9 * count
    assert not viewer.runner.trouble
    assert page.receive(lambda: viewer.runner.steps > before + 10)
    page.set("Time", "Pause")
    assert page.receive(lambda: not viewer.runner.playing)
    page.set("Time", "Play")
    assert page.receive(lambda: viewer.runner.playing)


def test_with_a_token_visers_page_and_web_socket_open_only_with_it():
    server, gate = start_viser(access_for("127.0.0.1", 0, TOKEN), "test")
    port = int(server.get_port())
    try:
        assert gate.access.url(port, token=True).endswith(f"?token={TOKEN}")
        for headers in ({}, {"Cookie": f"ig2mj_{port}={TOKEN}"}):
            with pytest.raises(InvalidStatus, match="401"):
                Page(port, **headers)
        for path, status in (("/", 401), (f"/?token={TOKEN}", 303)):
            asking = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
            asking.request("GET", path)
            answer = asking.getresponse()
            assert answer.status == status
            cookie = answer.getheader("Set-Cookie", "").partition(";")[0]
            asking.close()
        asking = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
        asking.request("GET", "/", headers={"Cookie": cookie})
        answer = asking.getresponse()
        assert answer.status == 200 and b"viser" in answer.read().lower()
        assert "frame-ancestors 'none'" in answer.getheader("Content-Security-Policy", "")
        asking.close()
        with Page(port, Cookie=cookie) as page:
            assert page.receive(lambda: "ReplayDoneMessage" in page.messages)
    finally:
        stop_viser(server)
