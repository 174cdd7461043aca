"""Observations of a world as policy servers expect them, by the names of each form.

| observation | openpi | vla-eval | GR00T |
|---|---|---|---|
| `rgb` | `observation/image` | `images` `head` | `video` `head` |
| `right_wrist/rgb` | `observation/wrist_image` | `images` `right_wrist` | `video` `right_wrist` |
| `CAMERA/rgb` | `observation/CAMERA_image` | `images` `CAMERA` | `video` `CAMERA` |
| `proprioception` | `observation/state` | `states` | `state` `state` |
| others | `observation/NAME` | `NAME` | `state` `NAME` |
| the instruction | `prompt` | `task_description` | `language` `task` |
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ig2mj.sensors.cameras import split_name

PREFIX, PROMPT, STATE = "observation/", "prompt", "proprioception"

BEGINS = "episode_start"
"""Key of openpi's form that our servers read: an episode begins with this observation."""

WORLD = "world"
"""Likewise: the number of the world that it is of; what a policy remembers belongs to it."""


def openpi_name(observation: str) -> str:
    """The key of an observation."""
    if observation == STATE:
        return f"{PREFIX}state"
    camera, sensor = split_name(observation)
    if sensor != "rgb":
        return PREFIX + observation
    usual = {"head": "image", "right_wrist": "wrist_image"}
    return PREFIX + usual.get(camera, f"{camera}_image")


def to_openpi(obs: Mapping[str, np.ndarray], instruction: str) -> dict[str, Any]:
    """`obs`: of one world."""
    return {**{openpi_name(name): np.ascontiguousarray(a) for name, a in obs.items()}, PROMPT: instruction}


def to_vla_eval(obs: Mapping[str, np.ndarray], instruction: str) -> dict[str, Any]:
    """`obs`: of one world."""
    found: dict[str, Any] = {"images": {}, "task_description": instruction}
    for name, array in obs.items():
        camera, sensor = split_name(name)
        if sensor == "rgb":
            found["images"][camera] = np.ascontiguousarray(array)
        else:
            found["states" if name == STATE else name] = np.ascontiguousarray(array)
    return found


def to_groot(obs: Mapping[str, np.ndarray], instructions: list[str]) -> dict[str, Any]:
    """`obs`: [W, ...], of all worlds; with an axis of one time step."""
    found: dict[str, Any] = {"video": {}, "state": {}, "language": {"task": [[text] for text in instructions]}}
    for name, array in obs.items():
        camera, sensor = split_name(name)
        if sensor == "rgb":
            found["video"][camera] = np.ascontiguousarray(array)[:, None]
        elif array.ndim == 2:
            found["state"]["state" if name == STATE else name] = np.ascontiguousarray(array, np.float32)[:, None]
    return found
