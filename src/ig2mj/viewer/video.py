"""Writing videos: frames go to an ffmpeg process, which makes a file of them."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
from types import TracebackType

import numpy as np
from jaxtyping import UInt8

from ig2mj.errors import EngineError, InputError, MissingDependencyError
from ig2mj.install_hint import pip_install_extra

GIF = ["-filter_complex", "[0:v]split[a][b];[a]palettegen[p];[b][p]paletteuse"]
H264 = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]  # it takes even sizes only
H264 += ["-c:v", "libx264", "-crf", "20", "-maxrate", "3700k", "-bufsize", "3700k"]  # at most 5 MB in 10 s
H264 += ["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
WEBP = ["-c:v", "libwebp_anim", "-loop", "0", "-quality", "55", "-compression_level", "4"]
FORMATS = {".mp4": H264, ".gif": GIF, ".webp": WEBP}
"""ffmpeg's options, by the file's ending."""


VIDEO_SIZE, FRAME_RATE = (1280, 720), 30.0
"""Pixels, width and height, and 1/s, of videos for people."""


class VideoWriter:
    """A video file that is written frame by frame; a context manager, or to be closed."""

    def __init__(self, file: str | os.PathLike, width: int, height: int, frames_per_second: float | int):
        """Starts ffmpeg.

        Args:
          file: its ending, one of `FORMATS`, says the format; an earlier file is replaced.
          width, height: of every frame, pixels.

        Raises:
          InputError: another ending. MissingDependencyError: there is no ffmpeg.
        """
        self._file, self._shape = pathlib.Path(file), (height, width, 3)
        form = FORMATS.get(self._file.suffix.lower())
        if form is None:
            raise InputError(file, "is not a video format that can be written", fix=f"use {' or '.join(FORMATS)}")
        source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{frames_per_second:g}"]
        # A process of its own and not imageio's writer, which forks: JAX's threads forbid that.
        self._ffmpeg = subprocess.Popen(
            [ffmpeg_program(), "-y", "-loglevel", "error", *source, "-i", "-", *form, str(self._file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )

    def add(self, frame: UInt8[np.ndarray, "Y X 3"]) -> None:
        """Adds a frame. Raises EngineError if ffmpeg does not take it."""
        assert frame.shape == self._shape
        assert self._ffmpeg.stdin is not None
        try:
            self._ffmpeg.stdin.write(np.ascontiguousarray(frame).data)
        except BrokenPipeError:
            self.close()

    def close(self) -> None:
        """Ends the file, once. Raises EngineError if ffmpeg could not write it."""
        assert self._ffmpeg.stdin is not None
        if self._ffmpeg.stdin.closed:
            return
        _, complaint = self._ffmpeg.communicate()
        if self._ffmpeg.returncode:
            lines = complaint.decode(errors="replace").strip().splitlines() or ["no reason given"]
            raise EngineError(f"{self._file}: ffmpeg wrote no video: {lines[-1]}")

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def ffmpeg_program() -> str:
    """Path of ffmpeg: the one that comes with the package imageio-ffmpeg, else one on the PATH.

    Raises:
      MissingDependencyError: there is none.
    """
    try:
        import imageio_ffmpeg

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        found = shutil.which("ffmpeg")
    if found is None:
        raise MissingDependencyError(f"no video without ffmpeg ({pip_install_extra('demo')})")
    return found
