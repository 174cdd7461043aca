"""`Task`: what is to be done in a home, as data. `ig2mj.envs` makes environments of tasks.

A task is a home with a few objects of the library added, conditions that its start states fulfil (a pool is sampled of
them), a goal, what the reward is made of, and for each robot where it starts and what an action moves.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

from ig2mj.agents.registry import find_robot
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.scene.tables import LinkKind
from ig2mj.tasks.custom.code import TaskCode
from ig2mj.tasks.points import Hand, Point

HORIZON = 200
"""Agent steps of 1/10 s in an episode: 20 s (paper, appendix A.3)."""

GROUND = ("floors", "carpet", "mat", "rug")
"""Categories that count as the floor: a robot that touches them has not run into anything."""

TABLES = (
    *("coffee_table", "breakfast_table", "console_table", "desk", "pedestal_table", "gaming_table"),
    *("countertop", "stand"),
)
"""Categories of what activities on a table may be done at, the most like their own first."""

Vector3 = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Weights:
    """Weights of the potential's terms (appendix of the paper).

    Attributes:
      goal: of the literals that hold: of their number, or where `share` is set of their share.
      distance: for each metre. pickup: for the first object in a hand. stain: for each stain that is gone.
      staged: only one distance counts at a time: to the first object until it is held, then from it to the second.
    """

    goal: float = 1.0
    distance: float = 1.0
    pickup: float = 0.0
    stain: float = 0.5
    share: bool = False
    staged: bool = False


HUMANOID_WEIGHTS = Weights()
FETCH_WEIGHTS = Weights(goal=20.0, distance=20.0, pickup=5.0, share=True, staged=True)
BIMANUAL_WEIGHTS = Weights(goal=20.0, distance=20.0, share=True)


@dataclasses.dataclass(frozen=True)
class Acts:
    """One robot in a task.

    Attributes:
      pos: where it starts, m. For the humanoid the middle of its body, 0.55 m above the floor. Without a height it
        stands on the floor; None: on free floor near the objects of interest, which it faces (`ig2mj.tasks.standing`).
      yaw: degrees it is turned about the vertical; at 0 it faces x.
      camera_tilt, camera_pan: rad, downwards and to the left, of Fetch's camera; None: the robot's own.
      hands: numbers of the hands that act; the rest of the robot stays where it is.
      weights: of the reward.
    """

    pos: Vector3 | tuple[float, float] | None
    yaw: float = 0.0
    camera_tilt: float | None = dataclasses.field(default=None, repr=False)  # part of the model's hash
    camera_pan: float = dataclasses.field(default=0.0, repr=False)  # as well
    hands: tuple[int, ...] = (0,)
    weights: Weights = FETCH_WEIGHTS


@runtime_checkable
class TaskLike(Protocol):
    """What tasks of all kinds have in common.

    Attributes:
      name: as `ig2mj.make` takes it. summary: one sentence. home: a shipped home. horizon: agent steps of an episode.
        code: what it says in functions of its author's; None: nothing.
      robots: names of those that it is made for, the usual one first. Others of the registry take part if they have
        what it takes. grasping: how hands hold unless something else is asked for.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def name(self) -> str: ...

    @property
    def summary(self) -> str: ...

    @property
    def home(self) -> str: ...

    @property
    def horizon(self) -> int: ...

    @property
    def robots(self) -> Collection[str]: ...

    @property
    def grasping(self) -> str: ...

    @property
    def code(self) -> TaskCode | None: ...


@dataclasses.dataclass(frozen=True)
class Near:
    """A start state counts only if the object's centre of mass is between `least` and `most` metres from `pos`."""

    object: str
    pos: Vector3
    most: float
    least: float = 0.0


@dataclasses.dataclass(frozen=True)
class Fit:
    """What an activity needs of a home that is not its own (`ig2mj.tasks.relocation`).

    Attributes:
      surface: what its objects lie on in its own home. surfaces: categories of what they may lie on, the best first.
      anchor: furniture at which it is done, "" for none. anchors: categories of that. link: of the anchor, must be in
        reach; None: its middle.
      target: m ahead and to the left of the robot where that is at home.
      of_home: loose objects of the own home, which are added to others.
      heights: m, least and most of the surface. on_floor: objects lie on the floor or a carpet.
      reach: m from the shoulder to the anchor. within: m from it to what lies on the surface. gap: m from the robot to
        the surface. aside: m, most by which the anchor is to the side.
    """

    surface: str
    surfaces: tuple[str, ...]
    anchor: str = ""
    anchors: tuple[str, ...] = ()
    link: LinkKind | None = None
    target: tuple[float, float] | None = None
    of_home: tuple[str, ...] = ()
    heights: tuple[float, float] = (0.3, 1.0)
    on_floor: bool = False
    reach: float = 1.0
    within: float = 0.9
    gap: float = 0.45
    aside: float = 0.75


@dataclasses.dataclass(frozen=True)
class Physical:
    """What differs with "physical" grasping, where only friction holds: objects that fit between two fingers.

    Attributes:
      objects: for each variant (`ig2mj.tasks.variants`) what is added to the home in the place of the task's `objects`.
      near: restrictions of start states in the place of the task's.
      robots: those that take part in another way than in the task.
    """

    objects: tuple[tuple[str, ...], ...]
    near: tuple[Near, ...]
    robots: Mapping[str, Acts] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Task:
    """What is to be done in a home, as data: what its start states fulfil, a goal, a reward, and robots.

    Attributes:
      name: as `ig2mj.make` takes it. summary: one sentence.
      home: a shipped home. objects: what is added to it from the object library.
      start: conditions of the start states. near: restrictions of where objects may be at the start.
      flat: objects that lie flat at the start, either way up: their own z axis is vertical.
      upright: objects whose own z axis points up at the start.
      goal: expression; an episode ends with success when it holds.
      objects_of_interest: the objects that the task is about; the first is what mittens take hold of.
      distances: pairs of points whose distances the reward is made of, in the order of the stages.
      stains_of: object whose stains are counted in the reward, or None.
      robots: name of each robot that it is made for, and how it takes part (others: `place_robot`).
      horizon: agent steps until an episode is truncated. grasping: mode unless another is asked for.
      physical: what is different with "physical" grasping; None: nothing.
      whole_actions: an action has every number of the robot's controller unless something else is asked for.
      code: what the task says in functions of its author's; None: nothing.
      fit: what it needs of other homes; None: it is bound to furniture at the places of its own. turned: degrees, a
        multiple of 90, by which everything is turned against the own home. roles: names of objects of the own home, and
        of those that have their parts here.
      expert: from a `tasks.experts.sight.ExpertView` to a list of one `tasks.experts.motion.HandMotion` for each acting
        hand: what it should do now. Pure and batched. None: the task has no scripted expert.
    """

    name: str
    summary: str
    home: str
    objects: tuple[str, ...]
    start: tuple[str, ...]
    near: tuple[Near, ...]
    goal: str
    objects_of_interest: tuple[str, ...]
    distances: tuple[tuple[Point, Point], ...]
    robots: Mapping[str, Acts]
    stains_of: str | None = None
    flat: tuple[str, ...] = ()
    upright: tuple[str, ...] = ()
    horizon: int = HORIZON
    grasping: str = "mitten"
    # Not in the text that recordings know a task by: where it applies, it shows in `objects` and `near`.
    physical: Physical | None = dataclasses.field(default=None, repr=False)
    expert: Callable[..., Any] | None = dataclasses.field(default=None, repr=False)
    whole_actions: bool = dataclasses.field(default=False, repr=False)
    code: TaskCode | None = dataclasses.field(default=None, repr=False)
    fit: Fit | None = dataclasses.field(default=None, repr=False)
    turned: int = dataclasses.field(default=0, repr=False)
    roles: Mapping[str, str] = dataclasses.field(default_factory=dict, repr=False)
    depth_range: ClassVar[float] = 3.0
    """m from the camera within which everything lies that matters: an arm's reach and the furniture around it."""

    def acts(self, robot: str) -> Acts:
        """How a robot takes part. Raises UnknownNameError."""
        if robot not in self.robots:
            raise UnknownNameError(f"robot that can do {self.name}", robot, self.robots)
        return self.robots[robot]

    def points(self, robot: str) -> tuple[tuple[Point, Point], ...]:
        """The distances, with the hand of this robot."""
        hands = self.acts(robot).hands
        return tuple((_own_hand(a, hands), _own_hand(b, hands)) for a, b in self.distances)


def _own_hand(point: Point, hands: tuple[int, ...]) -> Point:
    return Hand(hands[point.number]) if isinstance(point, Hand) else point


RIGHT = (1,)
BOTH = (0, 1)
"""Hands of the humanoid."""


def role_of(task: Task, robot: str, body: TaskRobot) -> Acts:
    """How a robot takes part in a task. One that the task does not list takes the role of the listed one whose base
    starts lowest: it stands on the floor there, and acts with its first hands, as many as the task takes.

    Args:
      robot: its name. body: the robot.

    Raises:
      EngineError: it has fewer hands than the task takes.
    """
    if robot in task.robots and not body.own_actions:  # a robot from a URDF may have the name of another
        return task.robots[robot]
    role = min(task.robots.values(), key=lambda listed: listed.pos[2] if listed.pos and len(listed.pos) == 3 else 0.0)
    hands = tuple(range(len(role.hands)))
    if task.whole_actions:
        hands = hands[: body.hand_count]
    if body.hand_count < len(hands):
        count = f"{body.hand_count or 'no'} hand{'s' * (body.hand_count > 1)}"
        raise EngineError(
            f"robot '{robot}' has {count}: it cannot do {task.name}, which takes {len(hands)} "
            f"({', '.join(task.robots)} can)"
        )
    pos = None if role.pos is None else (*role.pos[:2], body.stands)
    return dataclasses.replace(role, pos=pos, hands=hands)


def place_robot(task: Task, robot: str | TaskRobot, *, drives: bool = False) -> tuple[Task, TaskRobot]:
    """The task, which then lists the robot, and the robot at its start.

    Args:
      robot: a name of the registry, or a robot. drives: its base is free to move even where the paper's experiments
        pin it.

    Raises:
      UnknownNameError: no such robot. EngineError: see `role_of`.
    """
    name, body = find_robot(robot)
    role = role_of(task, name, body)
    body = body.for_activity(drives=drives, camera_tilt=role.camera_tilt, camera_pan=role.camera_pan)
    task = dataclasses.replace(task, robots={**task.robots, name: role})
    if role.pos is None:
        raise EngineError(f"{task.name} says nothing of where robot '{name}' starts: ig2mj.make finds a position")
    height = role.pos[2] if len(role.pos) == 3 else None
    return task, body.at(*role.pos[:2], math.radians(role.yaw), height)
