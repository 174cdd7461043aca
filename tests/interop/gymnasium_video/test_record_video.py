"""Gymnasium's `RecordVideo` writes an episode with MoviePy."""

from __future__ import annotations

import gymnasium
import numpy as np


def test_an_episode_becomes_a_video(tmp_path):
    env = gymnasium.make("ig2mj:ig2mj/PointNavigation-v0", render_mode="rgb_array", pool_size=2)
    video = gymnasium.wrappers.RecordVideo(env, str(tmp_path / "videos"), video_length=20)
    video.reset(seed=0)
    for _ in range(20):
        video.step(np.array([0.5, 0.2], np.float32))
    video.close()
    (file,) = (tmp_path / "videos").glob("*.mp4")
    assert file.stat().st_size > 10_000
