"""The near end of `pybullet_worker.py`."""

from __future__ import annotations

import json
import pathlib
import subprocess
import sys
from typing import Any

import numpy as np

from benchmarks.harness.paths import environment, module


class PyBulletError(RuntimeError):
    """PyBullet's process refused, or ended."""


class PyBulletProcess:
    """A home in PyBullet, in a process of its own that inherits this one's processor core. A context manager."""

    def __init__(self, folder: pathlib.Path, renderer: str | None = None):
        """Loads the scene in `folder`; `renderer` "tiny" or "egl" for pictures. Raises PyBulletError."""
        command = [sys.executable, *module("peers.pybullet_worker"), str(folder), *([renderer] if renderer else [])]
        self._log = (folder / f"pybullet_{renderer or 'physics'}.log").open("w+")
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, text=True, env=environment()
        )
        try:
            self.num_bodies = int(self._read()["ready"])
        except PyBulletError:
            self.close()
            raise

    def ask(self, what: str, **more: Any) -> Any:
        """One request (see the worker). Raises PyBulletError."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"do": what, **more}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # `_read` finds out why
        answer = self._read()
        if isinstance(answer, dict) and "error" in answer:
            raise PyBulletError(answer["error"])
        return answer

    def steps(self, count: int, size: int = 0) -> tuple[float, float]:
        """Takes steps, with a picture of `size` pixels after each; (seconds on the wall, seconds of the processor)."""
        answer = self.ask("steps", count=count, size=size)
        return answer["wall"], answer["cpu"]

    def positions(self) -> dict[str, np.ndarray]:
        """Base link frame's position [3] (m) of every body."""
        return {name: np.array(pose["pos"]) for name, pose in self.ask("poses").items()}

    def close(self) -> None:
        """Ends the process."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._log.close()

    def __enter__(self) -> PyBulletProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._process.wait()
            self._log.seek(0)
            last = [text.strip() for text in self._log.read().splitlines() if text.strip()][-3:]
            raise PyBulletError(f"PyBullet's process ended ({self._process.returncode}): {' | '.join(last)}")
        return json.loads(line)
