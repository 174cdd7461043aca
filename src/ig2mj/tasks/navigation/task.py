"""`NavigationTask`: a point to drive to or to reach, or furniture to close, as data.

The rules and their figures are iGibson's.
"""

from __future__ import annotations

import dataclasses

from ig2mj.tasks.custom.code import TaskCode


@dataclasses.dataclass(frozen=True)
class NavigationTask:
    """See the module's text.

    Attributes:
      name: as `ig2mj.make` takes it. summary: one sentence. home: a shipped home.
      robots: names of those that it is made for; the first is the usual one. Any other that drives, and has a hand
        where the goal takes one, can do it, too.
      goal: "point" (the base at a point of the floor), "reach" (the first hand at a point in the air) or "close"
        (furniture closed).
      objects: of the object library, put on free floor at random in every episode.
      added: further objects, which stay where they are (`ig2mj.tasks.added_objects`).
      others: number of TurtleBots that move at random.
      opened: categories of furniture whose joints are opened at random.
      target_dist: m along the floor from the start to the target, least and most.
      target_height: m above the floor, least and most, of a target to reach.
      tolerance: m from the target at which it is reached; iGibson's of its TurtleBot.
      geodesic: the potential is the length of the shortest way on the floor, not of the straight line.
      success_reward, potential_weight, collision_reward: of the reward's terms.
      prismatic_weight, revolute_weight: of the opening of drawers (1 / m) and doors (1 / rad) in the potential.
      max_collisions: agent steps with a collision after which an episode fails.
      fall: m below its start at which the robot has fallen off.
      horizon: agent steps until an episode is truncated. grasping: mode unless another is asked for.
      code: what the task says in functions of its author's; None: nothing.
    """

    name: str
    summary: str
    robots: tuple[str, ...]
    goal: str = "point"
    home: str = "birch"
    objects: tuple[str, ...] = ()
    added: tuple[str, ...] = ()
    others: int = 0
    opened: tuple[str, ...] = ()
    target_dist: tuple[float, float] = (1.0, 10.0)
    target_height: tuple[float, float] = (0.0, 0.0)
    tolerance: float = 0.36
    geodesic: bool = True
    success_reward: float = 10.0
    potential_weight: float = 1.0
    collision_reward: float = -0.1
    prismatic_weight: float = 1.0
    revolute_weight: float = 1.0
    max_collisions: int = 500
    fall: float = 0.03
    horizon: int = 500
    grasping: str = "physical"
    code: TaskCode | None = dataclasses.field(default=None, repr=False)


_LOOSE = ("canned_food", "cracker_box", "sugar_jar", "soup", "mayonnaise")
"""In place of the YCB data set's coffee can, crackers, sugar, tomato soup and mustard, which iGibson takes."""

_FURNITURE = (
    *("bottom_cabinet", "bottom_cabinet_no_top", "top_cabinet", "dishwasher", "fridge", "microwave", "oven"),
    *("washer", "dryer"),
)
"""iGibson's list. A forgotten comma joins its last two names to `washerdryer`, so that it never opens either."""

POINT_NAVIGATION = NavigationTask("PointNavigation", "Drive to a point of the floor.", ("turtlebot", "fetch"))

INTERACTIVE_NAVIGATION = NavigationTask(
    "InteractiveNavigation",
    "Drive to a point of the floor with five objects on it.",
    ("turtlebot", "fetch"),
    objects=_LOOSE,
)

DYNAMIC_NAVIGATION = NavigationTask(
    "DynamicNavigation",
    "Drive to a point of the floor with another moving robot.",
    ("turtlebot", "fetch"),
    others=1,
)

REACHING = NavigationTask(
    "Reaching",
    "Bring the gripper to a point in the air.",
    ("fetch",),
    goal="reach",
    target_dist=(1.0, 3.0),
    target_height=(0.0, 1.0),
    tolerance=0.1,
    geodesic=False,
)
"""Targets are at most 3 m away, where iGibson's are up to 10: its potential is the straight line, which leads through
walls."""

ROOM_REARRANGEMENT = NavigationTask(
    "RoomRearrangement",
    "Close the doors and drawers that are open.",
    ("fetch",),
    goal="close",
    opened=_FURNITURE,
    prismatic_weight=3.0,
    collision_reward=0.0,
)
