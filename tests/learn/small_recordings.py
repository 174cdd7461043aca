"""Recordings of the small environments, with labels and observations, as `ig2mj demos collect` writes them."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np
from small_envs import SmallEnv

from ig2mj.demos.writer import RunWriter

STEPS = ["action", "label", "reward/total", "terminated", "truncated", "success"]


def write_recording(
    env: SmallEnv, expert: Callable[[Any], np.ndarray], file: pathlib.Path, episodes: int, noise: float = 0.1
) -> None:
    """Plays an expert with noise on its actions until so many episodes have ended in all worlds."""
    names = list(env.observation_spaces)
    spaces = {n: [list(s.shape), np.dtype(s.dtype).name] for n, s in env.observation_spaces.items()}
    lists = {"spaces": spaces, "privileged_names": [], "action_names": list(range(env.size))}
    about = dict.fromkeys(("mujoco", "scene", "scene_hash", "model_hash"), "none")
    about |= {"task": type(env).__name__, "robot": "", "grasping": "", "worlds": env.num_worlds}
    rng, state, left = np.random.default_rng(0), env.reset(0), episodes
    with RunWriter(
        file,
        about | {name: json.dumps(value) for name, value in lists.items()},
        {},
        ["pos"],
        STEPS,
        range(env.num_worlds),
        names,
    ) as writer:

        def frame(obs, pos) -> list[np.ndarray]:
            return [np.array(pos), *(np.array(obs[name]) for name in names)]

        writer.begin({w: {} for w in range(env.num_worlds)}, [[]] * env.num_worlds, frame(state.obs, state.pos))
        while left > 0:
            label = np.asarray(expert(state), np.float32)
            action = np.clip(label + noise * rng.standard_normal(label.shape), -1, 1).astype(np.float32)
            state = env.step_autoreset(state, action)
            ends = [np.array(state.terminated), np.array(state.truncated), np.array(state.info["success"])]
            final = frame(state.info["final_obs"], state.pos)
            writer.add([[]] * env.num_worlds, final, [action, label, np.array(state.reward), *ends])
            done = np.flatnonzero(ends[0] | ends[1])
            left -= len(done)
            for world in done.tolist():
                writer.end(world, success=bool(ends[2][world]), complete=True)
            if len(done):
                writer.begin({int(w): {} for w in done}, [[]] * env.num_worlds, frame(state.obs, state.pos))
