"""Videos of a policy while it is trained (`ig2mj train --videos`): `ig2mj rollout` in a process of its own."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ig2mj.envs.environment import Environment

LONGEST = 300.0
"""Seconds that the end of a training waits for its last video."""


class TrainingVideos:
    """Videos of one held-out episode, the same start state each time, on the native engine of the processor.

    One at a time: while a video is being made, no other is started. Errors are in the video's log; training continues.
    """

    def __init__(self, run: pathlib.Path, every: float, rollout: Sequence[str]):
        """
        Args:
          run: the run's folder; videos go to its folder `videos`. every: seconds of training between two videos.
          rollout: the arguments of `ig2mj rollout` without agent and video.
        """
        self._folder, self._every, self._rollout = run / "videos", every, list(rollout)
        self._next, self._process = every, None

    @classmethod
    def of(cls, env: Environment, run: pathlib.Path, every: float, relaxed_thresholds: bool) -> TrainingVideos:
        """Of an environment in which a policy is trained; none where `every` is 0."""
        from ig2mj.tasks.added_objects import object_texts

        name = env.task.name if env.task.code is None else env.task.code.reference
        chosen = [name, "--robot", _robot(env), "--grasping", env.grasping]
        chosen += [f"--object={text}" for text in object_texts(env.config.objects)]
        return cls(run, every, chosen + ["--relaxed-thresholds"] * relaxed_thresholds)

    def offer(self, policy: pathlib.Path, seconds: float, last: bool = False) -> None:
        """Starts a video of this policy file, if it is time for one; `last`: in any case, and waits for it."""
        if not self._every:
            return
        if last:
            self._wait()
        elif seconds < self._next or (self._process is not None and self._process.poll() is None):
            return
        self._next = (seconds // self._every + 1) * self._every
        self._folder.mkdir(parents=True, exist_ok=True)
        stem = self._folder / f"{round(seconds):05d}"
        copy = stem.with_suffix(".npz")  # the next checkpoint replaces the policy itself
        copy.write_bytes(policy.read_bytes())
        command = ["nice", "-n", "10"] if shutil.which("nice") else []  # training goes first
        command += [sys.executable, "-m", "ig2mj", "rollout", *self._rollout, "--agent", str(copy)]
        command += ["--engine", "native", "--held-out", "--video", str(stem.with_suffix(".mp4"))]
        with stem.with_suffix(".log").open("wb") as log:
            self._process = subprocess.Popen(
                command,
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
                env={**os.environ, "JAX_PLATFORMS": "cpu"},
            )
        if last:
            self._wait()

    def _wait(self) -> None:
        if self._process is None:
            return
        try:
            self._process.wait(LONGEST)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _robot(env: Environment) -> str:
    """The robot's name, or the folder of one of the user's own."""
    made = env.made_with.get("robot")
    return made if isinstance(made, str) else env.robot
