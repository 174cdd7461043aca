"""`Task`: what is to be done in a home, as data. `ig2mj.envs` makes environments of tasks.

A task is a home with a few objects of the library added, conditions that its start states fulfil (a pool is sampled of
them), a goal, what the reward is made of, and for each robot where it starts and what an action moves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

from ig2mj.agents.base import Robot
from ig2mj.agents.fetch import Fetch
from ig2mj.agents.humanoid import Humanoid
from ig2mj.errors import UnknownNameError
from ig2mj.tasks.points import Hand, Point

HORIZON = 200
"""Agent steps of 1/10 s in an episode: 20 s (paper, appendix A.3)."""

GROUND = ("floors", "carpet", "mat", "rug")
"""Categories that count as the floor: a robot that touches them has not run into anything."""

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
      pos: where it starts, m. For the humanoid the middle of its body, 0.55 m above the floor.
      yaw: degrees it is turned about the vertical; at 0 it faces x.
      camera_tilt, camera_pan: rad, downwards and to the left, of Fetch's camera; None: the robot's own.
      hands: numbers of the hands that act; the rest of the robot stays where it is.
      weights: of the reward.
    """

    pos: Vector3
    yaw: float = 0.0
    camera_tilt: float | None = dataclasses.field(default=None, repr=False)  # part of the model's hash
    camera_pan: float = dataclasses.field(default=0.0, repr=False)  # as well
    hands: tuple[int, ...] = (0,)
    weights: Weights = FETCH_WEIGHTS


@runtime_checkable
class TaskLike(Protocol):
    """What environments of all kinds of tasks have in common.

    Attributes:
      name: as `ig2mj.make` takes it. summary: one sentence. home: a shipped home. horizon: agent steps of an episode.
      robots: names of those that can do it.
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


@dataclasses.dataclass(frozen=True)
class Near:
    """A start state counts only if the object's centre of mass is between `least` and `most` metres from `pos`."""

    object: str
    pos: Vector3
    most: float
    least: float = 0.0


@dataclasses.dataclass(frozen=True)
class Physical:
    """What is different in an activity where nothing holds but friction: objects that fit between two fingers.

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
    """See the module's text.

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
      robots: name of each robot that can do it, and how it takes part.
      horizon: agent steps until an episode is truncated. grasping: mode unless another is asked for.
      physical: what is different with "physical" grasping; None: nothing.
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


ROBOTS: dict[str, type] = {"humanoid": Humanoid, "fetch": Fetch}
"""Robots that tasks know by name."""

RIGHT = (1,)
BOTH = (0, 1)
"""Hands of the humanoid."""


def make_robot(task: Task, robot: str, *, drives: bool = False) -> Robot:
    """The robot at its start in a task. Fetch's base is pinned there, as in iGibson's experiments, unless it `drives`.

    Raises:
      UnknownNameError: the robot cannot do the task.
    """
    import math

    acts = task.acts(robot)
    half = math.radians(acts.yaw) / 2
    camera = {"camera_tilt": acts.camera_tilt, "camera_pan": acts.camera_pan}
    options = {"proprioception": "experiments", "pinned": not drives, **camera} if robot == "fetch" else {}
    return ROBOTS[robot](pos=acts.pos, quat=(math.cos(half), 0.0, 0.0, math.sin(half)), **options)
