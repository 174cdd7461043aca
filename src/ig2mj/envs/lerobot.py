"""`LeRobotVectorEnv`: many worlds as LeRobot evaluates them (`lerobot-eval`, EnvHub).

    env = make_env(n_envs=8, task="CookingMeat", cameras=("head", "right_wrist"))
    observation, info = env.reset(seed=0)     # {"pixels": {"rgb": ..., "right_wrist": ...}, "agent_pos": ...}

Pixels are uint8 [n_envs, height, width, 3] by camera; `agent_pos` is the robot's proprioception. Every step gives
`info["is_success"]` of every world; that of an episode's end is in `info["final_info"]`. Episodes begin again by
themselves in the step that ends them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ig2mj.envs.gymnasium import GymVectorEnv
from ig2mj.errors import EngineError
from ig2mj.sensors.cameras import HEAD

STATE = "proprioception"

FIXED = ("observations", "num_envs", "worlds")
"""Options that follow from others."""


def camera_key(camera: str) -> str:
    """Name of a camera's images in LeRobot's data sets and environments; `rgb` is the head's."""
    return "rgb" if camera == HEAD else camera.replace("/", "_")


@dataclasses.dataclass(frozen=True)
class _World:
    """One world of a `LeRobotVectorEnv`, to be read and rendered; all worlds are stepped together.

    Attributes:
      whole: the environment. world: number of this one.
    """

    whole: LeRobotVectorEnv
    world: int

    @property
    def task(self) -> str:
        """Its instruction."""
        return self.whole.task[self.world]

    task_description = task

    def render(self) -> np.ndarray:
        """Its image, uint8 [height, width, 3]."""
        return self.whole.call("render", self.world)[0]


class LeRobotVectorEnv(GymVectorEnv):
    """Many worlds as LeRobot evaluates them: pixels by camera, and `agent_pos`, the robot's proprioception."""

    def __init__(self, task: str, n_envs: int = 1, cameras: Sequence[str] = (HEAD,), **options: Any):
        """
        Args:
          cameras: names of cameras (`ig2mj.sensors.cameras`). options: of `ig2mj.make`; the size of images is
            `image_size`.

        Raises:
          EngineError: an option follows from others. See also `ig2mj.make`.
        """
        for name in FIXED:
            if name in options:
                raise EngineError(f"{name}: an environment for LeRobot takes n_envs, and cameras")
        self._cameras = {camera_key(c): "rgb" if c == HEAD else f"{c}/rgb" for c in cameras}
        observations = (STATE, *self._cameras.values())
        super().__init__(task, n_envs, AutoresetMode.SAME_STEP, observations=observations, **options)
        single = self.single_observation_space
        assert isinstance(single, spaces.Dict)
        pixels = {key: single[name] for key, name in self._cameras.items()}
        self.single_observation_space = spaces.Dict({"pixels": spaces.Dict(pixels), "agent_pos": single[STATE]})
        self.observation_space = batch_space(self.single_observation_space, n_envs)
        self.metadata = {**self.metadata, "render_fps": round(1 / self.env.period)}

    @property
    def task(self) -> tuple[str, ...]:
        """The instruction of each world."""
        return self.env.instruction(self.state)

    task_description = task

    @property
    def envs(self) -> tuple[_World, ...]:
        """The worlds one by one, as vector environments of copies have them."""
        return tuple(_World(self, world) for world in range(self.num_envs))

    @property
    def _max_episode_steps(self) -> int:
        return self.env.task.horizon

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """What each world has under a name, or gives when it is called, as vector environments of copies do."""
        if name in ("task", "task_description"):
            return self.task
        if name == "render":
            worlds = args or range(self.num_envs)
            return tuple(self.env.render(self._state(), world) for world in worlds)
        value = getattr(self, name)
        return tuple(value(*args, **kwargs) if callable(value) else value for _ in range(self.num_envs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """What each world has under a name."""
        return self.call(name)

    def _state(self) -> Any:
        if self.state is None:
            raise EngineError("reset the environment before its first image")
        return self.state

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `GymVectorEnv.reset`."""
        obs, info = super().reset(seed=None if seed is None else seed, options=options)
        return self._renamed(obs), _with_success(info)

    def step(self, actions: np.ndarray) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """See `GymVectorEnv.step`."""
        obs, reward, terminated, truncated, info = super().step(np.asarray(actions, np.float32))
        if "final_obs" in info:
            info["final_obs"] = self._renamed(info["final_obs"])
        if "final_info" in info:
            info["final_info"] = _with_success(info["final_info"])
        return self._renamed(obs), reward, terminated, truncated, _with_success(info)

    def _renamed(self, obs: Mapping[str, np.ndarray]) -> dict[str, Any]:
        pixels = {key: obs[name] for key, name in self._cameras.items()}
        return {"pixels": pixels, "agent_pos": obs[STATE]}


def _with_success(info: dict[str, Any]) -> dict[str, Any]:
    return {**info, "is_success": np.asarray(info["success"], bool)} if "success" in info else info


def make_env(n_envs: int = 1, use_async_envs: bool = False, **options: Any) -> LeRobotVectorEnv:
    """What LeRobot's EnvHub calls. `use_async_envs`: ignored, since worlds step together in any case. `options`: of
    `LeRobotVectorEnv`; default: CookingMeat from the cameras of the head and of both hands."""
    del use_async_envs
    options.setdefault("task", "CookingMeat")
    return LeRobotVectorEnv(options.pop("task"), n_envs, **options)
