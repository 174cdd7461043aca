"""Activities in homes that are not their own: which furniture takes part there, and where the robot stands.

    task = relocated(COOKING_MEAT, "willow")

An activity says in `Task.fit` what furniture it needs. In another home every piece of that kind is tried: the robot
stands on free floor in front of it, facing it as it does at home, and what it needs must be within reach of its hand.
Of all places that will do, the one that is most like the own home's is taken (`ig2mj.tasks.spots`). Everything follows
from the home's geometry at its start, so that the same home always gives the same task. At other furniture of the same
home are further places: "willow:1" is the second place of willow.

An activity without `Task.fit` goes only where everything is as in its own home: the furniture that it names is at the
same places, and so is what is next to objects that the activity puts at fixed places.

Homes are turned by quarters against each other (`Task.turned`): experts see the world as it is at home.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ig2mj.errors import EngineError
from ig2mj.sampling.conditions import read_conditions
from ig2mj.scene.additions import name_additions
from ig2mj.scene.bare_scenes import bare_scene
from ig2mj.scene.library import LibraryName
from ig2mj.scene.object_requests import read_request
from ig2mj.scene.paths import SHIPPED_HOMES, scene_folder
from ig2mj.scene.scene import Scene
from ig2mj.tasks.household import Household, axes_of
from ig2mj.tasks.spots import Spot, best_spot, further_spots, home_and_place
from ig2mj.tasks.task import Acts, Near, Task, Vector3

ELSEWHERE = 0.3
"""m by which furniture may stand elsewhere than in an activity's own home: hands still reach it."""

ELSE = 'ig2mj.make("activity/...", home=...) goes into any home that has what it needs'

SAME_TOP = 0.05
"""m by which a surface may be higher than that of an activity's own home, and the robot floats as high as there."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Asked:
    """A task and a folder, as a key: a training in several homes asks twice for each. Tasks have no hash; this very
    object counts."""

    task: Task
    folder: pathlib.Path

    def __hash__(self) -> int:
        return hash((id(self.task), self.folder))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Asked) and self.task is other.task and self.folder == other.folder


@functools.lru_cache(maxsize=32)
def _known_difference(asked: _Asked) -> str:
    return _difference(asked.task, asked.folder)


def relocated(task: Task, home: str | os.PathLike) -> Task:
    """The task in another home, or at another place of one.

    Raises:
      EngineError: it does not fit, or there are not so many places; says why. InputError: there is no such home.
    """
    home, place = home_and_place(home)
    if place:
        return _at_place(task, relocated(task, home), home, place)
    folder = scene_folder(home)
    if scene_folder(task.home) != folder:
        ships = folder.parent == SHIPPED_HOMES  # another home may change while the process runs
        reason = _known_difference(_Asked(task, folder)) if ships else _difference(task, folder)
        if reason and task.fit is not None:
            return _moved(task, home_name(home), best_spot(task.name, task.fit, str(folder)))
        if reason:
            raise EngineError(f"{task.name} cannot be done in '{folder.name}': {reason} ({ELSE})")
        if task.fit is None and (names := _names_of_added(task, folder)):
            return with_names(dataclasses.replace(task, home=home_name(home), roles=names), names)
    return dataclasses.replace(task, home=home_name(home))


def _at_place(task: Task, first: Task, home: str | os.PathLike, place: int) -> Task:
    """The task at another place of a home. `first`: at the first one. Raises EngineError: there are not so many."""
    spots = tuple[Spot, ...]()
    if (fit := task.fit) is not None:
        surface, anchor = first.roles.get(fit.surface, fit.surface), first.roles.get(fit.anchor, fit.anchor)
        spots = further_spots(fit, str(scene_folder(home)), surface, anchor)
    if place > len(spots):
        places = f"{len(spots) + 1} places, 0 to {len(spots)}" if spots else "one place"
        raise EngineError(f"place {place} of {task.name} in '{scene_folder(home).name}': it can be done at {places}")
    return _moved(task, home_name(home), spots[place - 1])


def reason_against(task: Task, home: str | os.PathLike) -> str:
    """Why a task cannot be done in a home, or at a place of it; "" if it can."""
    try:
        relocated(task, home)
    except EngineError as e:
        return str(e)
    return ""


def home_name(home: str | os.PathLike) -> str:
    """As tasks name a home: the name of one that ships, or the whole path of a folder."""
    folder = scene_folder(home)
    return os.fspath(home) if folder.parent == SHIPPED_HOMES else str(folder.resolve())


def _difference(task: Task, folder: pathlib.Path) -> str:
    """What a home has not, or has elsewhere, of what the task needs of its own home; "": nothing."""
    own, other = bare_scene(task.home), bare_scene(folder)
    arguments = [a for condition in read_conditions(task.start) for a in condition.arguments]
    named = [name for name in dict.fromkeys([*arguments, *task.objects_of_interest]) if name in own.object_names]
    missing = [name for name in named if name not in other.object_names]
    if missing:
        return f"it has no {', '.join(missing)}"
    if any(acts.pos is not None for acts in task.robots.values()) or task.near:  # else it goes where its furniture is
        both = [(scene, scene.start_data()) for scene in (own, other)]
        for name in named:
            here, there = (data.xpos[scene.tables.object_root[scene.object_index(name)]] for scene, data in both)
            if (apart := float(np.linalg.norm(here - there))) > ELSEWHERE:
                where = f"{apart:.1f} m from its position in '{own.name}'"
                return f"its {name} is {where}, which the activity needs"
    placed = [request for request in task.objects if read_request(request).place is not None]
    return _difference_around(task, own, other, placed) if placed or not named else ""


def _difference_around(task: Task, own: Scene, other: Scene, placed: list[str]) -> str:
    """How what is next to objects that are put at fixed places, and to robots, differs between two homes."""
    around, free = list[list[str]](), list[list[bool]]()
    robots = {name: acts.pos[:2] for name, acts in task.robots.items() if acts.pos is not None}
    for scene in (own, other):
        household = Household(bare_scene(scene.folder, placed))
        around.append([household.next_to(name) for name, _ in name_additions(scene.object_names, placed)])
        free.append([bool(household.free(np.array([pos]), 0.0)[0]) for pos in robots.values()])
    for request, here, there in zip(placed, *around, strict=True):
        if here != there:
            has = f"the activity has {here} next to '{request}' in '{own.name}'"
            return f"{has}, and here there is {there}"
    for robot, here, there in zip(robots, *free, strict=True):
        if here and not there:
            return f"robot '{robot}' stands on free floor in '{own.name}', and there is none here"
    return ""


def _names_of_added(task: Task, folder: pathlib.Path) -> dict[str, str]:
    """What objects that the task adds are called in a home, where that differs from its own home."""
    own, other = (name_additions(bare_scene(f).object_names, task.objects) for f in (task.home, folder))
    return {here: there for (here, _), (there, _) in zip(own, other, strict=True) if here != there}


def _own(task: Task) -> tuple[float, float, float]:
    """x, y (m) and yaw (degrees) of the robot at home."""
    acts = next(iter(task.robots.values()))
    assert acts.pos is not None and task.fit is not None
    return acts.pos[0], acts.pos[1], acts.yaw


@functools.lru_cache(maxsize=256)
def _own_top(home: str, surface: str) -> float:
    """m above the floor of a surface of a task's own home."""
    return float(Household(bare_scene(home)).box(surface)[1][2])


def _moved(task: Task, home: str, spot: Spot) -> Task:
    """The task at a spot of another home. The humanoid floats; above a surface that is higher than at home it floats as
    much higher, so that its eyes and hands are as far above the surface."""
    fit = task.fit
    assert fit is not None
    own = _own(task)
    names = {fit.surface: spot.surface} | ({fit.anchor: spot.anchor} if fit.anchor else {})
    objects = task.objects
    if fit.of_home:
        taken = bare_scene(home).object_names
        added = tuple(LibraryName(name.rsplit("_", 1)[0]) for name in fit.of_home)
        names |= dict(zip(fit.of_home, (n for n, _ in name_additions(list(taken), added)), strict=True))
        objects = (*objects, *added)
    ahead, left = axes_of(spot.quarter)
    home_ahead, home_left = axes_of(round(own[2] / 90.0))
    turned = 90 * ((spot.quarter - round(own[2] / 90.0)) % 4)
    here, there = np.array([spot.x, spot.y, 0.0]), np.array([own[0], own[1], 0.0])

    higher = 0.0 if fit.on_floor else round(spot.top - _own_top(task.home, fit.surface), 3)
    raised = higher if higher > SAME_TOP else 0.0

    def place(pos: Vector3 | tuple[float, float]) -> Any:
        offset = np.array([pos[0], pos[1], 0.0]) - there
        x, y, _ = here + (offset @ home_ahead) * ahead + (offset @ home_left) * left
        return (round(float(x), 3), round(float(y), 3), *pos[2:])

    def acts(name: str, one: Acts) -> Acts:
        assert one.pos is not None
        (x, y, *_), yaw = place(one.pos), (one.yaw + turned) % 360
        if name == "humanoid" and len(one.pos) == 3:
            return dataclasses.replace(one, pos=(x, y, round(one.pos[2] + raised, 3)), yaw=yaw)
        if yaw % 90 == 0:  # one that stands askew has its own place
            x, y = round(x + spot.arm * float(left[0]), 3), round(y + spot.arm * float(left[1]), 3)
        return dataclasses.replace(one, pos=(x, y, spot.height), yaw=yaw)

    def near(one: Near) -> Near:
        return dataclasses.replace(one, pos=place(one.pos))

    physical = task.physical
    if physical is not None:
        robots = {name: acts(name, one) for name, one in physical.robots.items()}
        physical = dataclasses.replace(physical, near=tuple(map(near, physical.near)), robots=robots)
    moved = dataclasses.replace(
        task,
        home=home,
        objects=objects,
        near=tuple(map(near, task.near)),
        robots={name: acts(name, one) for name, one in task.robots.items()},
        physical=physical,
        turned=turned,
        roles=names,
    )
    return with_names(moved, names)


_TEXTS = ("start", "near", "flat", "upright", "goal", "objects_of_interest", "distances", "stains_of", "physical")


def with_names(task: Task, names: Mapping[str, str]) -> Task:
    """The task in which objects have other names."""
    return dataclasses.replace(task, **{field: renamed(getattr(task, field), names) for field in _TEXTS})


def renamed(value: Any, names: Mapping[str, str]) -> Any:
    """A part of a task in which objects have other names."""
    if isinstance(value, str):
        found = re.compile(r"(?<![\w.])(" + "|".join(map(re.escape, names)) + r")(?![\w.])")
        return found.sub(lambda m: names[m.group(1)], value)
    if isinstance(value, tuple):
        return tuple(renamed(part, names) for part in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        own = {name: renamed(part, names) for name, part in fields.items() if not isinstance(part, Mapping)}
        return dataclasses.replace(value, **own)
    return value
