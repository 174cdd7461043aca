"""The video of an episode."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.envs.rollout import play
from ig2mj.showcase.episode_video import BETWEEN, ESTABLISHING, LAST, EpisodeVideo
from ig2mj.viewer import episode_view
from ig2mj.viewer.offscreen import default_backend
from ig2mj.viewer.video import ffmpeg_program


@pytest.mark.slow
@pytest.mark.skipif(default_backend() == "warp", reason="the ray caster takes seconds for a picture")
def test_a_film_shows_one_episode_and_its_end(tmp_path):
    import subprocess

    pytest.importorskip("imageio_ffmpeg", reason="makes the video")
    env = ig2mj.make("GraspingBook", engine="native", split="held_out", pool_size=4).with_horizon(2)
    video = EpisodeVideo(tmp_path / "book.mp4", env)
    played = play(env, lambda state: np.zeros((1, 6), np.float32), 2, watch=video.see)
    video.close()
    assert played.success == [False, False] and played.steps == 4
    # The robot in its room, the start, one step, and the last picture for a while; the second episode is not shown.
    counted = subprocess.run(
        [ffmpeg_program(), "-i", tmp_path / "book.mp4", "-map", "0:v", "-f", "framemd5", "-"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    frames = [line for line in counted.splitlines() if not line.startswith("#")]
    assert len(frames) == round(10 * ESTABLISHING * BETWEEN) + 2 * BETWEEN + LAST


@pytest.mark.slow
def test_where_a_robot_drives_the_camera_goes_along_and_the_goal_is_marked(tmp_path, monkeypatch):
    env = ig2mj.make("PointNavigation", engine="native", split="held_out", pool_size=4).with_horizon(4)
    seen = []

    def render(model, data, camera, *, width, height, segmentation=False, decorate=print):
        if segmentation:
            return np.full((height, width), -1)
        scene = mujoco.MjvScene(model, 20)
        decorate(scene)
        seen.append((camera.lookat, [np.array(scene.geoms[k].pos) for k in range(scene.ngeom)]))
        return np.zeros((height, width, 3), np.uint8)

    monkeypatch.setattr(episode_view, "render", render)
    video, bases = EpisodeVideo(tmp_path / "way.png", env), []

    def see(state):
        bases.append(np.asarray(state.batch.world.view.agent.base_pos)[0, 0, :2].copy())
        video.see(state)

    played = play(env, lambda state: np.ones((1, 2), np.float32), 1, in_order=True, watch=see)
    video.close()
    looks, marked = np.array([look[:2] for look, _ in seen]), [goals for _, goals in seen]
    np.testing.assert_allclose(looks[BETWEEN - 1 :: BETWEEN], bases, atol=0.02)
    assert np.linalg.norm(bases[-1] - bases[0]) > 0.1, "it drove"
    assert (tmp_path / "way.png").exists() and all(len(goals) == 1 for goals in marked)
    away = np.linalg.norm(marked[0][0][:2] - bases[0])
    goal = np.asarray(env.start_from(np.array([0])).obs["privileged_state"])[0, :3]
    assert env.privileged_names[:3] == ("goal_x", "goal_y", "goal_z")
    assert away == pytest.approx(np.linalg.norm(goal[:2]), abs=1e-3) and not played.success[0]
