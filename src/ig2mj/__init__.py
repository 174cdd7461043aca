"""ig2mj: iGibson 2.0 on MuJoCo and JAX."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ig2mj.envs.gymnasium_hook import register_now_or_later

if TYPE_CHECKING:
    from ig2mj import errors
    from ig2mj.demos.environments import record
    from ig2mj.envs.config import EnvConfig
    from ig2mj.envs.environment import Environment
    from ig2mj.envs.registry import default_config, list_envs, make
    from ig2mj.envs.state import EnvState
    from ig2mj.learn.policies import Policy
    from ig2mj.plugins import register
    from ig2mj.scene.scene import Scene, load_scene
    from ig2mj.simulation import Simulation
    from ig2mj.tasks.custom.definition import CustomTask, register_task
    from ig2mj.tasks.custom.start import StartWorld
    from ig2mj.tasks.custom.view import TaskView
    from ig2mj.tasks.task import Acts
    from ig2mj.worlds import Worlds
    from ig2mj.worlds.randomize import Randomize

    __version__: str

__all__ = [
    "Acts",
    "CustomTask",
    "EnvConfig",
    "EnvState",
    "Environment",
    "Policy",
    "Randomize",
    "Scene",
    "Simulation",
    "StartWorld",
    "TaskView",
    "Worlds",
    "default_config",
    "errors",
    "list_envs",
    "load_scene",
    "make",
    "record",
    "register",
    "register_task",
]

_HOME = {
    "Acts": "ig2mj.tasks.task",
    "CustomTask": "ig2mj.tasks.custom.definition",
    "EnvConfig": "ig2mj.envs.config",
    "EnvState": "ig2mj.envs.state",
    "Environment": "ig2mj.envs.environment",
    "Policy": "ig2mj.learn.policies",
    "Randomize": "ig2mj.worlds.randomize",
    "Scene": "ig2mj.scene.scene",
    "Simulation": "ig2mj.simulation",
    "StartWorld": "ig2mj.tasks.custom.start",
    "TaskView": "ig2mj.tasks.custom.view",
    "Worlds": "ig2mj.worlds",
    "default_config": "ig2mj.envs.registry",
    "list_envs": "ig2mj.envs.registry",
    "load_scene": "ig2mj.scene.scene",
    "make": "ig2mj.envs.registry",
    "record": "ig2mj.demos.environments",
    "register": "ig2mj.plugins",
    "register_task": "ig2mj.tasks.custom.definition",
}


def __getattr__(name: str) -> Any:
    """Imports public names and packages when they are first used: `import ig2mj` loads neither MuJoCo nor JAX."""
    if name == "__version__":
        from ig2mj.process.own_version import own_version

        return own_version()
    from ig2mj.process.public_names import public_name

    return public_name("ig2mj", name, _HOME)


def __dir__() -> list[str]:
    return sorted({*__all__, "__version__", *(name for name in globals() if name.startswith("__"))})


register_now_or_later()
