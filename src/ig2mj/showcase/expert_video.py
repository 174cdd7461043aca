"""A video of the scripted expert that cooks a steak in the shipped home birch."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ig2mj.callbacks import ProgressCallback


@dataclasses.dataclass(frozen=True)
class Filmed:
    """What happened: whether the steak is cooked in the end, after how many seconds, and whether there is a video."""

    cooked: bool
    seconds: float
    video: bool


def film(file: pathlib.Path, progress: ProgressCallback | None = None) -> Filmed:
    """Plays a held-out episode of CookingMeat with its expert, and writes a video where OpenGL draws."""
    from ig2mj.envs.experts import expert_of
    from ig2mj.envs.registry import make
    from ig2mj.envs.rollout import play
    from ig2mj.showcase.episode_video import EpisodeVideo
    from ig2mj.viewer.offscreen import default_backend

    report = progress or (lambda done, total, text="", /: None)
    report(0, None, "sampling where the steak lies")
    env = make("CookingMeat", robot="humanoid", engine="native", split="held_out", pool_size=1)
    video = EpisodeVideo(file, env, size=(640, 480)) if default_backend() != "warp" else None  # takes seconds an image

    def watch(state: Any) -> None:
        if video is not None:
            video.see(state)
        steps = int(state.info["steps"][0])
        report(steps, None, f"{steps * env.period:.1f} s")

    try:
        played = play(env, expert_of(env), 1, in_order=True, watch=watch)
    finally:
        if video is not None:
            video.close()
    return Filmed(bool(played.success[0]), played.steps * env.period, video is not None)
