"""Environments: tasks in batches of worlds, and their faces for other libraries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ig2mj.envs.environment import Environment, EnvState
    from ig2mj.envs.registry import list_envs, make

__all__ = ["EnvState", "Environment", "list_envs", "make"]

_HOME = {
    "EnvState": "ig2mj.envs.state",
    "Environment": "ig2mj.envs.environment",
    "list_envs": "ig2mj.envs.registry",
    "make": "ig2mj.envs.registry",
}


def __getattr__(name: str) -> Any:
    """Imports the public names when they are first used: names of environments are known without MuJoCo and JAX."""
    from ig2mj.process.public_names import public_name

    return public_name("ig2mj.envs", name, _HOME)
