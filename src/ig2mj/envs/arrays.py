"""Interfaces for NumPy and PyTorch: many worlds, without Gymnasium.

    env = TorchEnv(ig2mj.make("CookingMeat", worlds=4096))
    obs, info = env.reset(seed=0)
    obs, reward, terminated, truncated, info = env.step(action)     # tensors on the environment's device

With `autoreset` (the default) a world that is done begins its next episode in the same step: its observation is the new
episode's, and the last observation is `info["final_obs"]`. Without it, stepping a world that is done is an error.

PyTorch is not a dependency of ig2mj. Tensors are exchanged on the device (DLPack) and copied once there, because
the next step reuses the buffers of a state.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import ActionError, EngineError
from ig2mj.process import entry_point
from ig2mj.worlds.random_streams import Seed

Step = tuple[dict[str, Any], Any, Any, Any, dict[str, Any]]
"""Observations by name, reward [W], terminated [W], truncated [W], info; arrays of the face's kind."""


@entry_point
class NumpyEnv:
    """See the module's text. Attributes: env: the environment underneath. state: its state, None before the reset."""

    def __init__(self, env: Environment, autoreset: bool = True):
        self.env, self.autoreset = env, autoreset
        self.state: EnvState | None = None

    @property
    def num_worlds(self) -> int:
        """W."""
        return self.env.num_worlds

    @property
    def action_size(self) -> int:
        """n."""
        return self.env.action_space.shape[0]

    def reset(self, seed: Seed | None = None, mask: Any = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """New episodes: with a seed the first ones of that seed; else the next ones, of the masked worlds or of all.

        Raises:
          ActionError: the mask is not one of W worlds.
        """
        if mask is not None:
            mask = np.asarray(self._in(mask), bool)
            if mask.shape != (self.num_worlds,):
                raise ActionError(f"a mask has shape {(self.num_worlds,)}, not {mask.shape}")
        if seed is not None or self.state is None:
            self.state = self.env.reset(0 if seed is None else seed)
        else:
            self.state = self.env.reset(self.env.current(self.state) if mask is None else self.state, mask)
        return self._tree(self.state.obs), self._tree(self.state.info)

    def step(self, action: Any) -> Step:
        """One agent step of all worlds.

        Raises:
          ActionError: the action has another shape. EngineError: `reset` was never called, or without `autoreset` a
            world is done.
        """
        if self.state is None:
            raise EngineError("reset the environment before its first step")
        action = self._in(action)
        if self.autoreset:
            state = self.env.step_autoreset(self.state, action)
        else:
            over = np.flatnonzero(np.asarray(self.state.done))
            if len(over):
                raise EngineError(f"world {over[0]} is done: reset it before the next step (or make with autoreset)")
            state = self.env.step(self.state, action)
        self.state = state
        flags = self._out(state.terminated), self._out(state.truncated)
        return self._tree(state.obs), self._out(state.reward), *flags, self._tree(state.info)

    def close(self) -> None:
        """May be called twice."""
        self.env.close()

    def _tree(self, tree: Any) -> Any:
        return jax.tree.map(self._out, tree)

    def _in(self, array: Any) -> Any:
        return np.asarray(array)

    def _out(self, array: Any) -> Any:
        return np.array(array)


@entry_point
class TorchEnv(NumpyEnv):
    """`NumpyEnv` with PyTorch's tensors."""

    def __init__(self, env: Environment, autoreset: bool = True):
        """Raises ModuleNotFoundError: PyTorch is not installed."""
        import torch  # pyright: ignore[reportMissingImports]

        super().__init__(env, autoreset)
        self._torch = torch

    def _in(self, array: Any) -> Any:
        if not isinstance(array, self._torch.Tensor):
            return np.asarray(array)
        array = array.detach().contiguous()
        if array.dtype == self._torch.bool:  # DLPack has known booleans only lately
            return jnp.from_dlpack(array.to(self._torch.uint8)).astype(bool)
        return jnp.from_dlpack(array)

    def _out(self, array: Any) -> Any:
        array = jnp.asarray(array)
        if array.dtype == bool:
            return self._torch.from_dlpack(array.astype(jnp.uint8)).to(self._torch.bool)
        return self._torch.from_dlpack(array).clone()
