"""`PlaySession`: a person in an environment: keys in, control steps out, and what the corner of the window says.

    session = PlaySession(ig2mj.make("CookingMeat", engine="native", whole_actions=True, period=1 / 30))
    session.press(265)           # the arrow up
    session.step()               # 1/30 s

Nothing of it needs a window; `launch` gives it one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from ig2mj.envs.environment import Environment
from ig2mj.scene.scene import Scene
from ig2mj.viewer.interactive import open_viewer
from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.overlays import Clock, Label, Overlay
from ig2mj.viewer.play.actions import Wish, action_of
from ig2mj.viewer.play.first_view import first_view
from ig2mj.viewer.play.goal import Goal
from ig2mj.viewer.play.keys import Held, key_rows
from ig2mj.viewer.play.names import VisibleObjectNames, VisibleRoomNames
from ig2mj.viewer.sight_lines import SightLines
from ig2mj.viewer.state_marks import Mark

NEAR = 0.05
"""m before the robot's eye at which the window's camera turns, where it looks with that eye."""


class PlaySession:
    """One world of an environment, driven by keys.

    Attributes:
      env, state: the environment and where it is. closed, hand: of the robot's hands, and which one is moved.
      with_eye: the window looks with the robot's eye. successes: how often the goal was reached.
      sight_lines, goal: what is seen of the scene, and what is shown of the goal.
    """

    def __init__(self, env: Environment, seed: int = 0, clock: Callable[[], float] = time.monotonic):
        """At the start of the first episode. `env`: of one world, with whole actions; `clock`: s."""
        self.env, self.state, self._clock = env, env.reset(seed), clock
        self._controller = env.core.controllers[0]
        self._hands = int(np.sum(env.scene.tables.hand_agent == 0))
        self._keys, self.with_eye, self.successes = Held(), False, 0
        self.sight_lines = SightLines(env.scene.model)
        self.goal = Goal(env, self.sight_lines)
        self._begin()

    def _begin(self) -> None:
        self.hand = self._hands - 1 if self._hands else 0
        self.closed, self._resets, self._reached = [False] * max(self._hands, 1), set[int](), False
        self._choose_view = True

    @property
    def scene(self) -> Scene:
        """The household with the robot."""
        return self.env.scene

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of the world: live, so that forces put on it act."""
        return self.env.core.engine.to_mujoco(self.state.batch.world.physics, 0)[1]

    def press(self, key: int) -> None:
        """Takes a key (GLFW code) that went down."""
        command = self._keys.press(key, self._clock())
        if command == "close or open":
            self.closed[self.hand] = not self.closed[self.hand]
        elif command == "other hand" and self._hands:
            self.hand = (self.hand + 1) % self._hands
        elif command == "hand back to rest":
            self._resets.add(self.hand)
        elif command == "see with the robot's eye":
            self.with_eye = not self.with_eye
            self._choose_view = not self.with_eye

    def step(self) -> None:
        """One step of the environment with what the keys say now."""
        wish = Wish(self._keys.moves(self._clock()), self.hand, tuple(self.closed), frozenset(self._resets))
        self._resets.clear()
        action = action_of(wish, self._controller.action_names, self._controller.action_high, self.env.period)
        self.state = self.env.step(self.state, action[None].astype(np.float32))
        reached = bool(np.asarray(self.state.info["success"])[0])
        self.successes += reached and not self._reached
        self._reached |= reached

    def reset(self) -> None:
        """A new episode."""
        self.state = self.env.reset(self.state)
        self._begin()

    @property
    def heading(self) -> float:
        """Degrees about +z in which the robot looks."""
        w, _, _, z = np.asarray(self.state.batch.world.view.agent.base_quat, float)[0, 0]
        return math.degrees(2 * math.atan2(z, w))

    @property
    def holding(self) -> list[str | None]:
        """Object in each hand."""
        tables = self.scene.tables
        held = np.asarray(self.state.batch.world.view.held)[0][tables.hand_agent == 0]
        return [tables.object_names[int(np.argmax(row))] if row.any() else None for row in held]

    def view(self) -> FreeView | None:
        """Where the window looks from; None: where the mouse has put its camera.

        The view is chosen when an episode begins, and when the window no longer looks with the robot's eye.
        """
        if not self.with_eye:
            chosen = self.first_view() if self._choose_view else None
            self._choose_view = False
            return chosen
        agent = self.state.batch.world.view.agent
        pos, turn = np.asarray(agent.eye_pos, float)[0, 0], np.zeros(9)
        mujoco.mju_quat2Mat(turn, np.asarray(agent.eye_quat, float)[0, 0])
        ahead = -turn.reshape(3, 3)[:, 2]
        azimuth = math.degrees(math.atan2(ahead[1], ahead[0]))
        return FreeView(
            lookat=tuple(pos + NEAR * ahead),
            distance=NEAR,
            azimuth=azimuth,
            elevation=math.degrees(math.asin(np.clip(ahead[2], -1.0, 1.0))),
        )

    def first_view(self) -> FreeView:
        """The robot, its goal and the room, from behind the robot where that is possible."""
        model, tables, data = self.scene.model, self.scene.tables, self.data
        own = tables.body_agent[model.geom_bodyid] == 0
        opaque = own & self.sight_lines.opaque
        robot = np.flatnonzero(opaque if opaque.any() else own)
        point = self.goal.point(self.state)
        points = np.zeros((0, 3)) if point is None else point[None]
        return first_view(self.sight_lines, model, data, robot, self.heading, points, self.goal.geoms)

    def overlays(self) -> list[Overlay]:
        """Names of what is seen, the clock, and the session itself."""
        names = VisibleObjectNames(self.scene, self.sight_lines, self.goal.objects)
        return [names, VisibleRoomNames(self.scene, self.sight_lines), Clock(self.scene), self]

    def key_rows(self) -> list[tuple[str, str]]:
        """The robot's keys and what they do, in pairs."""
        return key_rows(self._controller.action_names)

    # What the corner of the window says (an overlay of the viewer).

    title = "robot"

    def labels(self, data: mujoco.MjData) -> Sequence[Label]:
        """The way to the goal, where it is a point."""
        return self.goal.labels(self.state)

    def marks(self, data: mujoco.MjData) -> Sequence[Mark]:
        """Where the goal is."""
        return self.goal.marks(data, self.state)

    def hide(self) -> None:
        """Nothing is left to hide: marks are of one image."""

    def lines(self, data: mujoco.MjData) -> Sequence[tuple[str, str]]:
        """The task, how much of the goal is reached, and what hands do."""
        progress = float(np.asarray(self.state.info["goal_progress"])[0])
        rows = [("" if number else "task", line) for number, line in enumerate(self.goal.text)]
        rows.append(("goal", "reached" if self._reached else f"{progress:.0%}"))
        way = None if self._reached else self.goal.way(data, self.state, self.heading, self.holding)
        if way is not None:
            rows.append(("next", way))
        names = ("left hand", "right hand") if self._hands == 2 else ("hand",)
        for number, (name, held) in enumerate(zip(names, self.holding, strict=False)):
            doing = held or ("closed" if self.closed[number] else "open")
            rows.append((f"> {name}" if number == self.hand and self._hands > 1 else name, doing))
        return rows


def launch(session: PlaySession) -> None:
    """Opens the window and plays until it is closed. Raises as `open_viewer`."""
    open_viewer(
        session.scene,
        session.data,
        session.step,
        reset=session.reset,
        overlays=session.overlays(),
        step_time=session.env.period,
        key_callback=session.press,
        more_keys=session.key_rows(),
        camera=session.view,
        own_letters=True,
        panels=False,
    )
