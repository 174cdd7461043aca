"""A session with a script for a person: grasping, walls, strangers, and a person who is suddenly gone."""

from __future__ import annotations

import copy
import dataclasses
import json
import threading

import numpy as np
import pytest
from apple_on_table import APPLE_ON_TABLE
from scipy.spatial.transform import Rotation
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from ig2mj.agents.humanoid.frames import HAND_POS, HAND_QUAT
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.vr import server
from ig2mj.vr.frames import Hand, PlayArea, Pose, PoseFrame
from ig2mj.vr.page_source import PagePoses
from ig2mj.vr.play_area import brought_to
from ig2mj.vr.server import HomePage
from ig2mj.vr.session import Session, person_environment
from ig2mj.web.access import access_for

pytestmark = pytest.mark.slow


class Script:
    """A `PoseSource` that says what it is told to."""

    def __init__(self):
        self.area, self.there, self.pulses = PlayArea(), True, []
        self.frame = PoseFrame(0.0, Pose.of((0, 0, 1.6), Rotation.identity()))

    def poll(self):
        return dataclasses.replace(self.frame, area=self.area) if self.there else None

    def stand_at(self, body):
        self.area = brought_to(self.area, self.frame.head, body)
        return self.poll()

    def pulse(self, hand, strength, seconds):
        self.pulses.append((hand, strength))

    def close(self):
        pass

    def stand(self, x, y, yaw):
        self.stand_at(Pose.of((x, y, 0.0), Rotation.from_euler("z", yaw)))
        self.yaw = yaw

    def reach(self, place, trigger=0.0):
        turn = Rotation.from_euler("z", self.yaw) * Rotation.from_quat(np.roll(HAND_QUAT[1], -1))
        pose = self.area.pose.inverse() * Pose.of(place, turn)
        self.frame = dataclasses.replace(self.frame, hands=(Hand(), Hand(pose, trigger=trigger)))


@pytest.fixture(scope="module")
def env():
    return person_environment(APPLE_ON_TABLE, pool_size=2)


def steps(session, count):
    for _ in range(count):
        session.step()


def place_of(session, name):
    view = session.state.batch.world.view
    return np.asarray(view.object_com)[0, session.env.scene.object_index(name)].astype(float)


def holds(session):
    return bool(np.asarray(session.state.batch.world.view.held)[0, 1].any())


def grasp_the_apple(session, person):
    steps(session, 1)
    apple = place_of(session, "apple_0")
    person.stand(apple[0], apple[1] - 0.6, np.pi / 2)
    steps(session, 30)
    for height, trigger, count in ((0.25, 0.0, 30), (0.055, 0.0, 30), (0.055, 1.0, 20), (0.3, 1.0, 30)):
        person.reach(np.add(apple, (0.0, -0.045, height)), trigger)
        steps(session, count)
    assert holds(session)
    return apple


def test_a_person_who_vanishes_with_an_apple_in_their_hand_leaves_it_and_their_hands_at_rest(env):
    person = Script()
    with Session(env, person, row=0) as session:
        apple = grasp_the_apple(session, person)
        assert (1, 0.3) in person.pulses and (0, 0.3) not in person.pulses
        before = np.asarray(session.state.batch.world.view.agent.base_pos)[0, 0].copy()
        person.there = False
        steps(session, 45)
        assert not holds(session)
        assert place_of(session, "apple_0")[2] < apple[2] + 0.05
        view, state = session.state.batch.world.view, session.state.batch.controllers[0]
        assert np.asarray(state.trigger)[0] == pytest.approx((0, 0))
        assert np.asarray(state.hand_pos)[0] == pytest.approx(HAND_POS)
        assert np.asarray(view.agent.base_pos)[0, 0] == pytest.approx(before, abs=0.01)
        assert np.abs(np.asarray(view.agent.hand_linvel)[0]).max() < 0.05


def test_a_body_that_runs_into_a_wall_is_felt_in_both_hands_and_stays_in_the_home(env):
    person = Script()
    with Session(env, person, row=0) as session:
        steps(session, 1)
        view = session.state.batch.world.view
        walls = session.env.scene.object_index("walls")
        side = float(np.asarray(view.aabb_high)[0, walls, 1])
        person.stand(1.6, side - 0.6, np.pi / 2)
        steps(session, 30)
        person.pulses.clear()
        person.stand(1.6, side + 0.5, np.pi / 2)  # the person walks on, the robot cannot
        steps(session, 30)
        assert {(0, 0.9), (1, 0.9)} <= set(person.pulses)
        assert np.asarray(session.state.batch.world.view.agent.base_pos)[0, 0, 1] < side - 0.1


def test_a_thousand_malformed_messages_change_nothing_in_the_home(env, monkeypatch):
    """Next to a page that is open, and bit for bit."""
    monkeypatch.setattr(server, "check_page", lambda: None)  # its library need not be there

    def visit(disturbed: bool) -> np.ndarray:
        person, over = Script(), threading.Event()
        with Session(env, person, row=0) as session, HomePage(session, PagePoses(), access_for(None, 0)) as page:
            sent = []
            if disturbed:
                strangers = threading.Thread(target=lambda: sent.append(malformed(page.server.port, 1000, over)))
                strangers.start()
            grasp_the_apple(session, person)
            if disturbed:
                strangers.join()
                assert sent == [1000] and page.server.gate.refused >= 800  # the layer below counts what is too long
                with connect(f"ws://127.0.0.1:{page.server.port}/") as socket:  # who is well-behaved is still served
                    assert json.loads(socket.recv())["type"] == "welcome"
            _, data = env.core.engine.to_mujoco(session.state.batch.world.physics, 0)
            return np.concatenate([data.qpos, data.qvel, data.ctrl])

    assert visit(False).tobytes() == visit(True).tobytes()


def malformed(port: int, count: int, over: threading.Event) -> int:
    """So many messages that no page sends, each ends its connection."""
    kinds = ['{"type": "devices"}', b"\x00" * 64, "x" * 70_000, '{"type": "desktop", "down": 3}', "[" * 2000, "null"]
    sent = 0
    while sent < count:
        try:
            with connect(f"ws://127.0.0.1:{port}/", open_timeout=30) as socket:
                socket.send(kinds[sent % len(kinds)])
                sent += 1
                while True:
                    socket.recv(timeout=30)
        except ConnectionClosed:
            pass
        except InvalidStatus:
            over.wait(0.05)
    return sent


def test_what_no_person_can_drive_is_refused(env):
    with pytest.raises(UnknownNameError, match="humanoid"):
        person_environment("PointNavigation")
    with pytest.raises(UnknownNameError):
        person_environment("Flying")
    with pytest.raises(EngineError, match="a person drives one humanoid"):
        Session(_with_two_worlds(env), Script())


def _with_two_worlds(env):
    two = copy.copy(env)
    two.num_worlds = 2
    return two


def test_it_is_told_where_the_time_of_a_frame_goes(env):
    with Session(env, Script(), row=0) as session:
        session.run(seconds=1.0)
        found = session.timing.summary()
        assert found["physics"] > 0 and found["states"] > 0 and found["rendering"] > 0
        assert session.timing.frames == session.track.count - 1
