"""What pages can look at: environments with someone who acts, and recordings frame by frame."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("viser")

import ig2mj
from ig2mj.demos import Recording, record
from ig2mj.demos.compact import write_compact
from ig2mj.envs.experts import expert_of
from ig2mj.web.recorded import Recorded
from ig2mj.web.runner import Runner
from ig2mj.web.shots import Mailbox, Shot, between
from ig2mj.web.sources import Acting, Source, Timeline

pytestmark = [pytest.mark.slow]


@pytest.fixture(scope="module")
def env():
    return ig2mj.make("CookingMeat", worlds=2, engine="native", pool_size=4).with_horizon(6)


@pytest.fixture(scope="module")
def file(env, tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded") / "runs.h5"
    expert, poses = expert_of(env), []
    with record(env, path) as played:
        state = played.reset(3)
        for _ in range(8):
            poses.append(np.array(state.batch.world.view.body_pos[0]))
            state = played.step_autoreset(state, np.asarray(expert(state)))
    return path, poses


def test_an_environment_goes_on_with_new_episodes_and_starts_from_any_row(env):
    source = Acting(env, expert_of(env))
    assert isinstance(source, Source) and source.rows == 4 and source.num_worlds == 2
    facts = []
    for _ in range(9):
        source.step()
        facts.append(dict(source.shot(0).facts)["agent step"])
    assert facts == ["1", "2", "3", "4", "5", "6", "0", "1", "2"]
    source.reset(1, 2)
    expected = env.core.starts.pool.rows(np.array([2])).physics.scene.qpos[0]
    found = env.core.engine.export(source._state.batch.world.physics, 1).scene.qpos
    np.testing.assert_array_equal(found, expected)
    assert dict(source.shot(0).facts)["agent step"] == "2" and source.shot(1).time == 0


def test_every_frame_of_a_recording_is_shown_as_it_was(file):
    path, poses = file
    with Recording(path) as recording:
        source = Recorded(recording)
        assert isinstance(source, Source) and isinstance(source, Timeline) and len(source.runs) == 4
        for frame in (5, 0, 3):
            source.seek(frame)
            np.testing.assert_allclose(source.shot(0).body_pos, poses[frame], atol=1e-6)
        source.seek(1, run=1)
        assert (source.run, source.frame) == (1, 1)
        source.seek(10**9)
        assert source.frame == source.frames - 1
        source.seek(-3)
        assert source.frame == 0


def test_a_thin_recording_shows_the_same_frames(file, tmp_path):
    thin = tmp_path / "thin.h5"
    with Recording(file[0]) as recording:
        write_compact(recording, thin, recording.runs[:2])
    with Recording(thin) as recording:
        source = Recorded(recording)
        for frame in (4, 5, 2, 6, 0):
            source.seek(frame)
            if frame < len(file[1]) and frame < 6:
                np.testing.assert_array_equal(source.shot(0).body_pos, file[1][frame])


def test_a_recording_plays_to_its_end_and_from_the_start_again(file):
    with Recording(file[0]) as recording:
        source = Recorded(recording)
        runner = Runner(source, playing=True, speed=10.0)
        runner.start()
        seen: list[Shot] = []
        while (shot := runner.mailbox.get(10)) is not None and source.frame < source.frames - 1:
            seen.append(shot)
        assert not runner.playing or runner.mailbox.get(2) is not None
        runner.play(True)
        assert runner.mailbox.get(10) is not None
        runner.stop()
    assert seen and not runner.trouble


def test_the_mailbox_keeps_the_newest_shot_and_remembers_a_jump(file):
    with Recording(file[0]) as recording:
        source = Recorded(recording)
        first = source.shot(0, jump=True)
        source.seek(2)
        second = source.shot(0)
        box = Mailbox()
        box.put(first)
        box.put(second)
        got = box.get(0)
        assert got is not None and got.jump and got.time == second.time
        assert box.get(0) is None
        pos, quat = between(first, second, 0.5)
        np.testing.assert_allclose(pos, (first.body_pos + second.body_pos) / 2, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(quat, axis=1), 1, atol=1e-6)
