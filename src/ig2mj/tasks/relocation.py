"""Activities in homes that are not their own: which furniture takes part there, and where the robot stands.

    task = relocated(COOKING_MEAT, "willow")

An activity says in `Task.fit` what furniture it needs. In another home every piece of that kind is tried: the robot
stands on free floor in front of it, facing it as it does at home, and what it needs must be within reach of its hand.
Of all places that will do, the one that is most like the own home's is taken. Everything follows from the home's
geometry at its start, so that the same home always gives the same task.

An activity without `Task.fit` goes only where everything is as in its own home: the furniture that it names is at the
same places, and so is what is next to objects that the activity puts at fixed places.

Homes are turned by quarters against each other (`Task.turned`): experts see the world as it is at home.

Axis: N points.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.errors import EngineError
from ig2mj.sampling.conditions import read_conditions
from ig2mj.scene.additions import name_additions
from ig2mj.scene.bare_scenes import bare_scene
from ig2mj.scene.library import LibraryName
from ig2mj.scene.object_requests import read_request
from ig2mj.scene.paths import SHIPPED_HOMES, scene_folder
from ig2mj.scene.scene import Scene
from ig2mj.tasks.household import SITS, Household, axes_of
from ig2mj.tasks.task import Acts, Fit, Near, Task, Vector3

SHOULDER = (-0.15, -0.15, 0.85)
"""m ahead, to the left and above the floor of the robot: from where the right hand reaches, as at home."""

STEP = 0.05
"""m between positions that are tried, and between points of a surface that count."""

AROUND = 1.2
"""m around the furniture within which the robot may stand."""

MARGIN = 0.06
"""m from the edge of a surface on which nothing is put."""

AHEAD, ASIDE = (0.28, 0.95), 0.55
"""m ahead of the robot, least and most, and to either side, where it sees what lies before it."""

VIEW = (0.05, 1.0)
"""m from the middle of a robot to its camera, ahead, and the tangent of half the angle that the camera sees."""

SEEN = 0.7
"""Share of a surface in reach that the camera sees, at least."""

ENOUGH = 24
"""Points of a surface in reach: 0.06 m2. With fewer, hardly any sampled state would count."""

ELSEWHERE = 0.3
"""m by which furniture may stand elsewhere than in an activity's own home: hands still reach it."""

ELSE = 'ig2mj.make("activity/...", home=...) goes into any home that has what it needs'

SAME_TOP = 0.05
"""m by which a surface may be higher than that of an activity's own home, and the robot floats as high as there."""


@dataclasses.dataclass(frozen=True)
class Spot:
    """Where a task could be done.

    Attributes:
      surface, anchor: objects of the home; anchor "" where none is needed. x, y: m. quarter: turns by 90 degrees of
        what the robot faces, from x. height: m of the floor there. top: m above the floor of the surface.
      likeness: larger is more like the task's own home.
    """

    surface: str
    anchor: str
    x: float
    y: float
    quarter: int
    height: float
    top: float
    likeness: float


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
    """The task in another home. Raises EngineError: it does not fit; says why. InputError: there is no such home."""
    folder = scene_folder(home)
    if scene_folder(task.home) != folder:
        ships = folder.parent == SHIPPED_HOMES  # another home may change while the process runs
        reason = _known_difference(_Asked(task, folder)) if ships else _difference(task, folder)
        if reason and task.fit is not None:
            return _moved(task, home_name(home), _spot(task.name, task.fit, _own(task), str(folder)))
        if reason:
            raise EngineError(f"{task.name} cannot be done in '{folder.name}': {reason} ({ELSE})")
        if task.fit is None and (names := _names_of_added(task, folder)):
            return with_names(dataclasses.replace(task, home=home_name(home), roles=names), names)
    return dataclasses.replace(task, home=home_name(home))


def reason_against(task: Task, home: str | os.PathLike) -> str:
    """Why a task cannot be done in a home; "" if it can."""
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
def _spot(name: str, fit: Fit, own: tuple[float, float, float], folder: str) -> Spot:
    """The best spot in a home. Raises EngineError: there is none."""
    home = Household(bare_scene(folder))
    label = home.scene.name
    anchors = [a for kind in fit.anchors for a in home.of(kind)] if fit.anchors else [""]
    surfaces = [(s, rank) for rank, kind in enumerate(fit.surfaces) for s in home.of(kind)]
    if not anchors:
        raise EngineError(f"{name} cannot be done in '{label}': it has no {' and no '.join(fit.anchors)}")
    if not surfaces:
        raise EngineError(f"{name} cannot be done in '{label}': it has no {', '.join(fit.surfaces)}")
    found: list[Spot] = []
    for rank in range(len(fit.surfaces)):  # the next kind only where there is nothing of the one before
        pairs = [(a, s) for a in anchors for s, of in surfaces if of == rank]
        found += [spot for a, s in pairs for spot in _spots(home, fit, a, s, rank)]
        if found and not anchors[0]:
            break
    if not found:
        words = f"with {' or '.join(fit.anchors)} " if fit.anchors else ""
        raise EngineError(
            f"{name} cannot be done in '{label}': nowhere on its free floor is a {' or '.join(fit.surfaces)} {words}"
            "within a robot's reach"
        )
    return max(found, key=lambda spot: spot.likeness)


def _points(low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> Float[np.ndarray, "N 3"]:
    """Points of the top of a box."""
    spread = np.array([*np.meshgrid(*(np.arange(low[k] + MARGIN, high[k] - MARGIN, STEP) for k in (0, 1)))])
    return np.column_stack([spread.reshape(2, -1).T, np.full(spread[0].size, high[2])])


def _in_view(ahead: Float[np.ndarray, "N"], left: Float[np.ndarray, "N"]) -> Bool[np.ndarray, "N"]:
    """Whether a robot's camera sees points so many metres ahead and to the left of it."""
    return np.abs(left) < VIEW[1] * (ahead - VIEW[0])


def _spots(home: Household, fit: Fit, anchor: str, surface: str, rank: int) -> Iterator[Spot]:
    """Positions from which a surface and an anchor are in reach."""
    if anchor == surface:
        return
    low, high = home.box(surface)
    if fit.on_floor:
        high = high.copy()
        if high[2] > SITS:
            return
    elif not fit.heights[0] <= high[2] <= fit.heights[1]:
        return
    target, quarters = None, range(4)
    if anchor and fit.link is not None:
        target, facing = home.link(anchor, fit.link), home.facing(anchor)
        if target is None or facing is None:
            return
        quarters = [(facing + 2) % 4]
    elif anchor:
        box = home.box(anchor)
        target = np.array([*(0.5 * (box[0] + box[1]))[:2], box[1][2]])
    points = _points(low, high)
    if not len(points):
        return
    middle = np.array([*(0.5 * (low + high))[:2]]) if target is None else target[:2]
    reach = AROUND + (0.5 * (high - low)[:2].max() if target is None else 0.0)
    for quarter in quarters:
        ahead, left = axes_of(quarter)
        step = STEP if anchor else 2 * STEP
        ticks = np.arange(-reach, reach + step, step)
        at = np.round((middle + np.array(np.meshgrid(ticks, ticks)).reshape(2, -1).T) / STEP) * STEP
        if target is None:  # in front of the surface
            beside = np.maximum(low[:2] - at, at - high[:2])
            at = at[np.linalg.norm(np.maximum(beside, 0.0), axis=1) < fit.gap + 0.1]
        if not len(at):
            continue
        at = at[home.free(at, 0.0)]
        if target is not None:
            off = target[:2] - at
            seen = (off @ ahead[:2] > 0.2) & (np.abs(off @ left[:2]) < fit.aside)
            at = at[seen]
        for x, y in at:
            spot = _judged(home, fit, anchor, surface, rank, (float(x), float(y), quarter), points, target)
            if spot is not None:
                yield spot


def _judged(
    home: Household,
    fit: Fit,
    anchor: str,
    surface: str,
    rank: int,
    pose: tuple[float, float, int],
    points: Float[np.ndarray, "N 3"],
    target: Float[np.ndarray, "3"] | None,
) -> Spot | None:
    """A position, if it will do. `points`: of the surface. `target`: what of the anchor must be in reach."""
    x, y, quarter = pose
    ahead, left = axes_of(quarter)
    here = np.array([x, y, 0.0])
    shoulder = here + SHOULDER[0] * ahead + SHOULDER[1] * left + np.array([0, 0, SHOULDER[2]])
    if target is not None and np.linalg.norm(target - shoulder) > fit.reach:
        return None
    off = points - here
    least, most = AHEAD
    seen = (off @ ahead > least) & (off @ ahead < most) & (np.abs(off @ left) < ASIDE)
    in_reach = np.linalg.norm(points - shoulder, axis=1) < fit.within
    near = seen & in_reach
    if near.sum() < ENOUGH:
        return None
    visible = 1.0 if fit.on_floor else float(_in_view(off @ ahead, off @ left)[in_reach].mean())
    height = home.floor(here[:2])
    likeness = min(float(near.sum()), 120.0) / 120.0 - 0.3 * rank
    if fit.target is not None and target is not None:
        offset = target - here
        likeness -= 2.0 * float(np.hypot(offset @ ahead - fit.target[0], offset @ left - fit.target[1]))
    likeness -= 2.0 * max(0.0, SEEN - visible)
    gap = float((off[near] @ ahead).min())
    likeness -= 2.0 * max(0.0, gap - fit.gap)
    return Spot(
        surface, anchor, round(x, 3), round(y, 3), quarter, round(height, 3), round(float(points[0, 2]), 3), likeness
    )


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
        height = one.pos[2] + raised if name == "humanoid" and len(one.pos) == 3 else spot.height
        return dataclasses.replace(one, pos=(*place(one.pos)[:2], round(height, 3)), yaw=(one.yaw + turned) % 360)

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
