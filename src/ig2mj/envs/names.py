"""Names of all environments, for Gymnasium and for the shell; no task is imported for them."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Sequence
from typing import Any

from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
from ig2mj.tasks.registry import REGISTERED, TASKS, split_reference

NAMESPACE, VERSION = "ig2mj", 0
"""Of the names that Gymnasium knows: ig2mj/CookingMeat-v0."""

NAMES = tuple(TASKS)

_NAME = re.compile(rf"(?:{NAMESPACE}/)?(?P<name>[^/]+?)(?:-v(?P<version>\d+))?")

_ACTIVITY = re.compile(rf"(?:{NAMESPACE}/)?activity/(?P<name>[^/]+?|.+\.bddl)(?:-v(?P<version>\d+))?")


def short_name(name: str) -> str | None:
    """ "CookingMeat" for CookingMeat, ig2mj/CookingMeat and ig2mj/CookingMeat-v0; None for unknown names."""
    match = _NAME.fullmatch(name)
    if match is None or int(match["version"] or VERSION) != VERSION:
        return None
    return match["name"] if match["name"] in NAMES or match["name"] in REGISTERED else None


def activity_name(name: str) -> str | None:
    """cleaning_windows of activity/cleaning_windows and ig2mj/activity/cleaning_windows-v0, and the path of
    activity/folder/mine.bddl; None of other names."""
    match = _ACTIVITY.fullmatch(name)
    return None if match is None or int(match["version"] or VERSION) != VERSION else match["name"]


def refuse_path(name: str, file: object, element: str) -> None:
    """Raises InputError where a file names its task by the path of a BDDL definition, or of code, of another file."""
    if (activity_name(name) or name).endswith(".bddl") or split_reference(name) is not None:
        raise InputError(file, f"{name[:80]!r} is the path of a file, not the name of a task", element=element)


def register(gymnasium: Any) -> None:
    """Registers all environments with Gymnasium (the module); may be called twice. Imports nothing."""
    face = "ig2mj.envs.gymnasium"
    for name in (*NAMES, *(own for own in REGISTERED if own.isidentifier())):
        full = f"{NAMESPACE}/{name}-v{VERSION}"
        if full not in gymnasium.registry:
            gymnasium.register(
                full,
                entry_point=f"{face}:GymEnv",
                vector_entry_point=f"{face}:GymVectorEnv",
                kwargs={"task": REGISTERED[name].reference if name in REGISTERED else name},
                disable_env_checker=True,  # it would reset and step once more than is needed; a test runs it
            )


def unknown_environment(name: str, known: Sequence[str]) -> Ig2mjError:
    """The error of a name that is no environment's. known: names of environments."""
    from ig2mj.scene.paths import shipped_homes  # `import ig2mj` reads this module, and loads no MuJoCo

    if name.startswith("goal/"):
        return Ig2mjError(
            f"'{name}': a goal is named goal/HOME GOAL, such as \"goal/small_home (inside apple_0 fridge_0)\", with"
            " every bracket closed"
        )
    also = "BEHAVIOR-100's are activity/NAME (`ig2mj activity list`), tasks of yours FILE.py:NAME"
    if name and (name in shipped_homes() or pathlib.Path(name).is_dir()):
        goal = f'"goal/{name} GOAL"'
        return Ig2mjError(
            f"'{name}' is a home, and an environment is a task in one: {', '.join(known)}, {goal}; {also};"
            f" `ig2mj view {name}` shows the home"
        )
    return UnknownNameError("environment", name.removeprefix(f"{NAMESPACE}/"), known, also=also)
