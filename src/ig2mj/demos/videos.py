"""`EpisodeVideos`: images of many episodes, appended to few mp4 files; an episode is found by its start time."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

PIXELS, ODD_PIXELS = "yuv420p", "yuv444p"
"""Pixel formats; the first halves the resolution of colours and needs even widths and heights."""


class EpisodeVideos:
    """Video files of one camera. Attributes: about: their entry in `info.json`."""

    def __init__(self, path: Callable[[dict[str, int]], pathlib.Path], fps: int, codec: str):
        """`path`: maps chunk and file index to the file's path."""
        self._path, self._fps, self._codec = path, fps, codec
        self._place = {"chunk_index": 0, "file_index": 0}
        self._file: pathlib.Path | None = None
        self._container: Any = None
        self._stream: Any = None
        self._frames = 0
        self.about: dict[str, Any] = {}

    def add(self, images: np.ndarray, limit: int) -> tuple[dict[str, int], float]:
        """Appends an episode, uint8 [T, height, width, 3].

        Args:
          limit: size in MB after which the next episode starts a new file.

        Returns:
          Indices of the episode's file, and its start time in that file in seconds.
        """
        # Codecs buffer frames: the file of a short episode may not exist yet.
        if self._file is not None and self._file.exists() and self._file.stat().st_size > limit * 2**20:
            self.close()
            self._place = {**self._place, "file_index": self._place["file_index"] + 1}
            if self._place["file_index"] == 1000:
                self._place = {"chunk_index": self._place["chunk_index"] + 1, "file_index": 0}
        import av

        if self._container is None:
            self._open(*images.shape[1:3])
        container: Any = self._container
        start = self._frames / self._fps
        for image in images:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame.pts, self._frames = self._frames, self._frames + 1
            container.mux(self._stream.encode(frame))
        return self._place, start

    def close(self) -> None:
        """Finishes the open file; may be called twice."""
        if self._container is not None:
            self._container.mux(self._stream.encode())
            self._container.close()
        self._container, self._file, self._frames = None, None, 0

    def _open(self, height: int, width: int) -> None:
        import av

        self._file = self._path(self._place)
        self._container = av.open(str(self._file), "w")
        # A key frame every other image: readers access single images in random order.
        self._stream = self._container.add_stream(self._codec, rate=self._fps, options={"g": "2", "crf": "18"})
        pixels = PIXELS if width % 2 == height % 2 == 0 else ODD_PIXELS
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, pixels
        self._stream.time_base = Fraction(1, self._fps)
        self.about = {
            "video.height": height,
            "video.width": width,
            "video.codec": self._codec,
            "video.pix_fmt": pixels,
            "video.is_depth_map": False,
            "video.fps": self._fps,
            "video.channels": 3,
            "has_audio": False,
        }
