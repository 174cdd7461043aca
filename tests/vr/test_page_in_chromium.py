"""The page of `ig2mj vr` in headless Chromium: a person with a headset puts an apple on the table."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from apple_on_table import APPLE_ON_TABLE
from chromium import HEAD, PLACE, STICK, chromium, wear_headset
from inverses import grip_of_hand, to_xr
from scipy.spatial.transform import Rotation

from ig2mj.agents.humanoid.frames import HAND_QUAT
from ig2mj.demos import Recording, Replayer
from ig2mj.vr.frames import Pose
from ig2mj.vr.mapping import heading
from ig2mj.vr.page_source import PagePoses
from ig2mj.vr.recorded import RecordedPoses
from ig2mj.vr.server import PAGE, THREE, HomePage
from ig2mj.vr.session import Session, person_environment
from ig2mj.web.access import access_for

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (PAGE / THREE).is_file(), reason="needs three.js (`make web`)"),
]

HEAD_AT = (0.0, 1.6, 0.0)
"""XR's axes: the person's head, who turns it and walks by the stick."""


PITCH = np.deg2rad(35)
"""They look down a little, at their hands."""


@pytest.fixture(scope="module")
def env():
    return person_environment(APPLE_ON_TABLE, pool_size=2)


class Person:
    """Drives IWER's headset by what is so in the home."""

    def __init__(self, page, session: Session, source: PagePoses):
        self.page, self.session, self.source = page, session, source
        self.trigger = 0.0
        self.until(self.ready)
        # IWER places a controller's pointer; its grip is beside that.
        self.grip = Pose.of((0, 0, 0), Rotation.identity())
        self.place(np.array([0.3, 1.2, -0.4]), Rotation.identity())
        self.until(lambda: np.linalg.norm(self.said()[0] - (0.3, 1.2, -0.4)) < 0.2)
        time.sleep(0.5)
        pos, quat = self.said()
        self.grip = Pose.of(pos - (0.3, 1.2, -0.4), Rotation.from_quat(quat))

    def said(self) -> tuple[np.ndarray, np.ndarray]:
        """The right grip, as the page told it: XR's axes."""
        pose = self.source.poll().hands[1].pose
        return (np.full(3, np.inf), np.zeros(4)) if pose is None else grip_of_hand(1, pose)

    def place(self, pos: np.ndarray, turn: Rotation) -> None:
        """Moves the right controller: XR's axes."""
        self.page.evaluate(PLACE, ["right", pos.tolist(), turn.as_quat().tolist(), self.trigger, 0.0])

    def object(self, name: str) -> np.ndarray:
        view, scene = self.session.state.batch.world.view, self.session.env.scene
        return np.asarray(view.object_com)[0, scene.object_index(name)]

    def ready(self) -> bool:
        frame = self.source.poll()
        return frame is not None and frame.hands[1].pose is not None

    def head(self) -> Pose:
        return self.source.area.pose * self.source.poll().head

    def look(self, yaw: float) -> None:
        """Turns the head to a direction in the world."""
        turn = Rotation.from_euler("z", yaw - self.source.area.yaw) * Rotation.from_euler("y", PITCH)
        self.page.evaluate(HEAD, [list(HEAD_AT), to_xr(Pose.of((0, 0, 0), turn))[1].tolist()])
        self.until(lambda: abs(np.angle(np.exp(1j * (heading(self.head()) - yaw)))) < 0.02)

    def walk_to(self, x: float, y: float, fastest: float = 1.0) -> None:
        """By the left stick, until within 12 cm; slower pictures take more tries."""
        for tilt in (fastest, *[min(fastest, 0.3)] * 5):
            way = np.array([x, y]) - self.head().pos[:2]
            if np.linalg.norm(way) < 0.12:
                return
            self.look(float(np.arctan2(way[1], way[0])))
            ahead = way / np.linalg.norm(way)
            self.page.evaluate(STICK, ["left", 0.0, -tilt])
            self.until(lambda ahead=ahead: (np.array([x, y]) - self.head().pos[:2]) @ ahead < 0.08)
            self.page.evaluate(STICK, ["left", 0.0, 0.0])
            self.until(lambda: self.source.poll().hands[0].stick == (0.0, 0.0))
        raise AssertionError("never got there")

    def hand_to(self, place, trigger: float | None = None, exact: float = 0.03) -> None:
        """The right hand's wrist to a place in the world, no faster than it follows; palm down, fingers where the head
        faces."""
        self.trigger = self.trigger if trigger is None else trigger
        level = Rotation.from_euler("z", heading(self.head()))
        turn = level * Rotation.from_quat(np.roll(HAND_QUAT[1], -1))
        start = self.hand()
        for share in np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(place - start) / 0.08))[1:]:
            point = start + share * (place - start)
            pos, quat = grip_of_hand(1, self.source.area.pose.inverse() * Pose.of(point, turn))
            pointer = Rotation.from_quat(quat) * self.grip.turn.inv()
            self.place(pos - pointer.apply(self.grip.pos), pointer)
            near = exact if share == 1.0 else 0.12
            self.until(lambda point=point, near=near: np.linalg.norm(self.hand() - point) < near)

    def hand(self) -> np.ndarray:
        return np.asarray(self.session.state.batch.world.view.agent.hand_pos)[0, 1].astype(float)

    def over(self, place, height: float) -> np.ndarray:
        """Where the wrist is when the palm lies over a place."""
        yaw = heading(self.head())
        return np.add(place, (-0.045 * np.cos(yaw), -0.045 * np.sin(yaw), height))

    def holds(self) -> bool:
        return bool(np.asarray(self.session.state.batch.world.view.held)[0, 1].any())

    def until(self, true, seconds: float = 60.0, pause: float = 0.02) -> None:
        end = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < end, "that took too long"
            time.sleep(pause)


def enter(page, served) -> None:
    """Opens the page in a headset that is not there, and enters: a picture for each eye."""
    wear_headset(page)
    page.goto(served.server.url)
    page.wait_for_function("ig2mj.ready")
    page.dispatch_event("#enter", "click")
    page.wait_for_function("ig2mj.views == 2")


def test_a_person_in_a_headset_puts_an_apple_on_the_table_and_the_recording_replays(env, tmp_path, pytestconfig):
    source, stop = PagePoses(stale=30.0), threading.Event()
    pictures = pytestconfig.rootpath / "out" / "vr"
    pictures.mkdir(parents=True, exist_ok=True)
    file = pictures / "visit.h5"
    with chromium(640, 360) as page, Session(env, source, file, row=0) as session:
        driving = threading.Thread(target=session.run, kwargs={"stop": stop})
        driving.start()
        try:
            with HomePage(session, source, access_for(None, 0)) as served:
                enter(page, served)
                page.wait_for_function("ig2mj.pictures > 3")
                person = Person(page, session, source)
                person.until(lambda: session.memory.body is not None)
                person.until(lambda: abs(person.head().pos[2] - 1.6) < 0.01)

                walked, apple = person.head().pos.copy(), person.object("apple_0")
                person.walk_to(float(apple[0]), float(apple[1]) - 0.6)
                assert np.linalg.norm(person.head().pos[:2] - walked[:2]) > 0.5
                person.look(np.pi / 2)
                person.hand_to(person.over(apple, 0.25))
                person.hand_to(person.over(apple, 0.055))
                page.screenshot(path=pictures / "before_the_grasp.png")
                person.hand_to(person.over(apple, 0.055), trigger=1.0, exact=1.0)
                person.until(person.holds)
                person.hand_to(person.over(apple, 0.3), exact=0.06)
                assert person.object("apple_0")[2] > apple[2] + 0.1
                person.until(lambda: [1, 0.3] in page.evaluate("ig2mj.pulses"))
                page.screenshot(path=pictures / "both_eyes.png")

                for yaw in (np.pi / 4, 0.0, -np.pi / 4, -np.pi / 2):  # the hand goes with them
                    person.look(yaw)
                    before = Rotation.from_euler("z", yaw).apply((0.55, -0.1, -0.45))
                    person.hand_to(person.head().pos + before, exact=0.1)
                    assert person.holds(), yaw
                index = env.scene.object_index("coffee_table_0")
                view = session.state.batch.world.view
                x, y, top = (float(v) for v in np.asarray(view.aabb_high)[0, index] - (0.3, 0.25, 0.0))
                person.walk_to(x, y + 0.45, fastest=0.2)
                person.look(-np.pi / 2)
                assert person.holds()
                person.hand_to(np.array([x, y, top + 0.35]), exact=0.08)
                person.hand_to(np.array([x, y, top + 0.15]), exact=0.08)
                page.screenshot(path=pictures / "over_the_table.png")
                assert person.holds()
                person.hand_to(np.array([x, y, top + 0.15]), trigger=0.0, exact=0.2)
                person.until(lambda: session.succeeded)
                person.hand_to(np.array([x, y, top + 0.4]), exact=0.1)
                page.wait_for_function("ig2mj.looks.holds")
                page.screenshot(path=pictures / "apple_on_the_table.png")
                assert all(holds for _, holds in page.evaluate("ig2mj.looks.goal"))
        finally:
            stop.set()
            driving.join()
    with Recording(file) as recording:
        (run,) = recording.runs
        assert run.attributes["success"] is True
        heads = run.rows("steps/devices/head", 0, 100)
        assert heads.shape[1:] == (8,)
        done = Replayer(recording, env=env)(check=True)
        assert done.differences == [] and done.frames == run.frames > 100
        actions = np.concatenate(
            [run.rows("steps/action", k, min(k + 200, run.frames - 1)) for k in range(0, run.frames - 1, 200)]
        )
    again = RecordedPoses(file)  # the devices say it again, and the same comes of it
    with Session(env, again, tmp_path / "again.h5", row=0) as session:
        while not again.over:
            session.step()
    with Recording(tmp_path / "again.h5") as recording:
        (same,) = recording.runs
        assert same.attributes["success"] is True and same.frames == run.frames
        for k in range(0, run.frames - 1, 200):
            rows = same.rows("steps/action", k, min(k + 200, run.frames - 1))
            assert np.array_equal(rows, actions[k : k + 200])


def test_slow_physics_never_slows_the_head(env, monkeypatch):
    """Control steps that take 300 ms: pictures and messages with poses come as fast as before."""
    source, stop = PagePoses(stale=30.0), threading.Event()
    with chromium(160, 90) as page, Session(env, source, row=0) as session:
        driving = threading.Thread(target=session.run, kwargs={"stop": stop})
        driving.start()
        try:
            with HomePage(session, source, access_for(None, 0)) as served:
                enter(page, served)

                def rates() -> tuple[float, float, float]:
                    before, steps, start = (
                        page.evaluate("[ig2mj.pictures, ig2mj.poses]"),
                        session.track.count,
                        time.monotonic(),
                    )
                    time.sleep(4.0)
                    after, seconds = page.evaluate("[ig2mj.pictures, ig2mj.poses]"), time.monotonic() - start
                    return (
                        (after[0] - before[0]) / seconds,
                        (after[1] - before[1]) / seconds,
                        (session.track.count - steps) / seconds,
                    )

                time.sleep(2.0)
                pictures, poses, _ = rates()
                step = env.core.engine.step
                monkeypatch.setattr(env.core.engine, "step", lambda *a, **k: (time.sleep(0.3), step(*a, **k))[1])
                slow_pictures, slow_poses, slow_steps = rates()
        finally:
            stop.set()
            driving.join()
    assert slow_steps < 3.4
    assert slow_pictures > 0.6 * pictures
    assert slow_poses > 0.6 * poses and slow_poses > 5 * slow_steps
