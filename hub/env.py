"""Environments of ig2mj for LeRobot's EnvHub, which calls `make_env`.

ig2mj must be installed: `pip install "ig2mj[learn]"`. The variables IG2MJ_TASK and IG2MJ_CAMERAS choose the task and
its cameras, such as GraspingBook and head,right_wrist.
"""

from __future__ import annotations

import os
from typing import Any


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None) -> Any:
    """A vector environment of `n_envs` worlds."""
    from ig2mj.envs import lerobot

    cameras = tuple(os.environ.get("IG2MJ_CAMERAS", "head").split(","))
    return lerobot.make_env(n_envs, use_async_envs, task=os.environ.get("IG2MJ_TASK", "CookingMeat"), cameras=cameras)
