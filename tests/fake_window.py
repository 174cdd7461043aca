"""A stand-in for the window of MuJoCo's viewer."""

from __future__ import annotations

import contextlib

import mujoco


class FakeHandle:
    """Stands for MuJoCo's window: closes itself after some pictures, and notes what it was told."""

    def __init__(self, model, pictures: int):
        self.left, self.synced, self.texts = pictures, 0, []
        self.cam, self.perturb, self.opt = mujoco.MjvCamera(), mujoco.MjvPerturb(), mujoco.MjvOption()
        self.user_scn = mujoco.MjvScene(model, maxgeom=100)
        self.viewport = mujoco.MjrRect(0, 0, 800, 600)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def is_running(self) -> bool:
        self.left -= 1
        return self.left >= 0

    def lock(self):
        return contextlib.nullcontext()

    def set_texts(self, texts) -> None:
        self.texts.append(texts)

    def sync(self) -> None:
        self.synced += 1
