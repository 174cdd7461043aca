"""The film of an episode."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.envs.rollout import play
from ig2mj.showcase.episode_film import BETWEEN, LAST, EpisodeFilm
from ig2mj.viewer.film import ffmpeg_program
from ig2mj.viewer.offscreen import default_backend


@pytest.mark.slow
@pytest.mark.skipif(default_backend() == "warp", reason="the ray caster takes seconds for a picture")
def test_a_film_shows_one_episode_and_its_end(tmp_path):
    import subprocess

    env = ig2mj.make("GraspingBook", engine="native", split="held_out", pool_size=4).with_horizon(2)
    film = EpisodeFilm(tmp_path / "book.mp4", env)
    played = play(env, lambda state: np.zeros((1, 6), np.float32), 2, watch=film.see)
    film.close()
    assert played.success == [False, False] and played.steps == 4
    # The start, one step, and the last picture for a while; the second episode is not shown.
    counted = subprocess.run(
        [ffmpeg_program(), "-i", tmp_path / "book.mp4", "-map", "0:v", "-f", "framemd5", "-"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    frames = [line for line in counted.splitlines() if not line.startswith("#")]
    assert len(frames) == 2 * BETWEEN + LAST
