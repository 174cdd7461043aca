"""Videos: both formats, and what goes wrong."""

from __future__ import annotations

import shutil
import sys

import numpy as np
import pytest
from PIL import Image

from ig2mj.errors import EngineError, InputError, MissingDependencyError
from ig2mj.viewer.video import FORMATS, VideoWriter, ffmpeg_program


def frames(count: int, height: int = 48, width: int = 64) -> list[np.ndarray]:
    return [np.full((height, width, 3), 40 * n, np.uint8) for n in range(count)]


def test_an_mp4_has_its_frames_and_its_speed(tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="counts the frames")
    with VideoWriter(tmp_path / "a.mp4", 64, 48, 5) as video:
        for frame in frames(6):
            video.add(frame)
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4"))
    assert count == 6 and seconds == pytest.approx(6 / 5, abs=0.01)


def test_a_gif_keeps_the_colours(tmp_path):
    with VideoWriter(tmp_path / "a.GIF", 64, 48, 10) as video:
        for frame in frames(4):
            video.add(frame)
    with Image.open(tmp_path / "a.GIF") as gif:
        assert (gif.size, gif.n_frames, gif.info["duration"]) == ((64, 48), 4, 100)
        gif.seek(3)
        assert np.abs(np.asarray(gif.convert("RGB")).astype(int) - 120).max() <= 2


def test_odd_sizes_are_no_error(tmp_path):
    with VideoWriter(tmp_path / "a.mp4", 33, 21, 5) as video:
        video.add(frames(1, 21, 33)[0])
    assert (tmp_path / "a.mp4").stat().st_size > 0


def test_what_cannot_be_written_is_one_error(tmp_path):
    with pytest.raises(
        InputError, match=r"a.avi: is not a video format that can be written \(use .mp4 or .gif or .webp\)"
    ):
        VideoWriter(tmp_path / "a.avi", 64, 48, 5)
    video = VideoWriter(tmp_path / "absent" / "a.mp4", 64, 48, 5)
    with pytest.raises(EngineError, match=r"a.mp4: ffmpeg wrote no video: .*No such file"):
        video.close()
    video.close()


def test_without_ffmpeg_the_extra_that_brings_it_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"no video without ffmpeg .*\[demo\]"):
        ffmpeg_program()


def test_the_view_command_offers_these_formats():
    from ig2mj.cli.view import VIDEOS

    assert set(VIDEOS) == set(FORMATS)
