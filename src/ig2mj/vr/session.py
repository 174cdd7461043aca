"""`Session`: one person in one home, for as long as they stay.

    env = person_environment("CookingMeat")
    with Session(env, source, record="visit.h5") as session:
        session.run()

Thirty times a second the newest frame of the devices becomes an action, the home makes a control step, and what came
of it is published: poses (`track`), marks and tints of states, truth of the goal, pulses for the hands. Whoever draws
takes these from another thread, at a rate of their own; rendering never waits for physics.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ig2mj.demos.environments import RecordedEnvironment, record
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.registry import AnyTask, find_task, make
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.predicates import logic
from ig2mj.predicates.logic import And, Atom, Exactly, Not, Or, Pairing
from ig2mj.process import entry_point
from ig2mj.vr.frames import to_arrays
from ig2mj.vr.haptics import Touch
from ig2mj.vr.looks import Looks, looks_of
from ig2mj.vr.mapping import Memory, action_of, robot_of
from ig2mj.vr.sources import PoseSource
from ig2mj.vr.timing import Timing
from ig2mj.vr.track import PoseTrack

PERIOD = 1 / 30
"""s of a frame: one control step (iGibson's demonstrations were made at 30 Hz)."""

HOURS = 12
"""Horizon of an episode: as long as anybody stays."""

LOOKS_EVERY = 6
"""Frames from one look at states (particles, tints, the goal's literals) to the next."""

Physics = Callable[..., Any]


def person_environment(task: str | AnyTask, grasping: str = "assisted", **options: Any) -> Environment:
    """The environment of a task for a person: one world, the humanoid, all of its numbers, an action every 1/30 s.

    Raises:
      UnknownNameError: no such task, or one that the humanoid cannot do. Others as of `ig2mj.make`.
    """
    task = find_task(task) if isinstance(task, str) else task
    if "humanoid" not in task.robots:
        raise UnknownNameError(f"robot that can do {task.name}", "humanoid", task.robots)
    env = make(
        task,
        "humanoid",
        1,
        "native",
        grasping,
        observations=("proprioception",),
        whole_actions=True,
        period=PERIOD,
        **options,
    )
    return env.with_horizon(HOURS * 3600 * 30)


@entry_point
class Session:
    """See the module's text.

    Attributes:
      env, source: what is driven by whom. state: of the environment. track, looks: see the module's text.
      pulses: [2] strengths of the last frame. timing: of the frames. memory: of the mapping.
      frame: that the last action was made of. succeeded: the goal has held at some time.
    """

    def __init__(
        self,
        env: Environment,
        source: PoseSource,
        record_to: str | os.PathLike | None = None,
        seed: int = 0,
        row: int | None = None,
        person: Callable[[str], None] | None = None,
    ):
        """Starts an episode.

        Args:
          record_to: HDF5 of everything that happens, with what devices say. row: of the pool; None: a random one.
          person: called with remarks for people.

        Raises:
          InputError: the recording cannot be written. EngineError: the environment is not one for a person.
        """
        if (
            env.num_worlds != 1
            or env.robot != "humanoid"
            or env.action_space.shape != (28,)
            or not env.core.engine.live
        ):
            raise EngineError("a person drives one humanoid of the native engine (`vr.session.person_environment`)")
        self.env = env
        if record_to is not None:
            rows = {name: array[None] for name, array in to_arrays(None).items()}
            self.env = record(env, record_to, devices=rows, past_success=True)
        self.source, self.timing, self.track = source, Timing(), PoseTrack()
        env.core.watch_physics(lambda: self.timing.part("physics"))
        self._scale = env.core.controls.high
        self._touch, self._tell = Touch(env.scene), person or (lambda text: None)
        self.memory, self.frame, self.succeeded = Memory(), None, False
        self.pulses = np.zeros(2)
        self._warm(env)
        self.state: EnvState = self.env.reset(seed) if row is None else self.env.start_from(np.array([row]), seed)
        self._goal = goal_lines(env)
        self._placed = -1
        self.looks: Looks = looks_of(self)
        self._publish()

    def step(self) -> None:
        """One frame: devices, action, control step, publication."""
        frame = self.source.poll()
        with self.timing.part("states"):
            robot = robot_of(self.state.batch.world.view, self.state.batch.controllers[0])
            if frame is not None and frame.head is not None and self._placed != self.memory.took_hold:
                self._placed = self.memory.took_hold
                frame = self.source.stand_at(robot.body)
            action, self.memory = action_of(frame, robot, self.memory)
            if isinstance(self.env, RecordedEnvironment):
                self.env.devices = {name: array[None] for name, array in to_arrays(frame).items()}
            self.frame = frame
            self.state = self.env.step(self.state, (action / self._scale)[None].astype(np.float32))
        with self.timing.part("rendering"):
            self._publish()
            self._feel()

    def run(self, seconds: float | None = None, stop: threading.Event | None = None) -> None:
        """Frames at their rate, until `stop` is set or the time is over. One that takes longer delays the next; none is
        caught up with, so that a slow home is slow for hands and objects alike."""
        end = None if seconds is None else time.monotonic() + seconds
        due = time.monotonic()
        while (stop is None or not stop.is_set()) and (end is None or time.monotonic() < end):
            self.step()
            due = max(due + PERIOD, time.monotonic())
            with self.timing.part("waiting"):
                time.sleep(max(0.0, due - time.monotonic()))
            self.timing.end_frame()

    def goal(self) -> list[tuple[str, bool]]:
        """What the goal is made of, with the truth it needs, and whether that holds."""
        truth = np.asarray(self.state.status.literals)[0].tolist()
        return [(text, holds == requested) for (text, requested), holds in zip(self._goal, truth, strict=False)]

    def close(self) -> None:
        """Ends the recording; may be called twice."""
        self.env.close()
        self.source.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @staticmethod
    def _warm(env: Environment) -> None:
        """Compiles what the first frames need, before anybody wears anything."""
        state = env.reset(0)
        for _ in range(2):
            state = env.step(state, np.zeros((1, 28), np.float32))

    def _publish(self) -> None:
        view = self.state.batch.world.view
        self.track.add(np.asarray(view.body_pos)[0], np.asarray(view.body_quat)[0])
        if self.track.count % LOOKS_EVERY == 1:
            self.looks = looks_of(self)
        if not self.succeeded and bool(np.asarray(self.state.info["success"])[0]):
            self.succeeded = True
            self._tell("the goal holds; the session goes on until you end it")

    def _feel(self) -> None:
        _, data = self.env.core.engine.to_mujoco(self.state.batch.world.physics, 0)
        self.pulses = self._touch(data, self.state.batch.world.view)
        for hand, strength in enumerate(self.pulses):
            if strength > 0:
                self.source.pulse(hand, float(strength), PERIOD)


def goal_lines(env: Environment) -> list[tuple[str, bool]]:
    """For each literal of an environment's goal, in their order: its text, and whether it shall be true.

    A literal that the goal names both ways counts as needed true.
    """
    goal = env.core.rules.goal if env.core.rules is not None else None
    if goal is None:
        return []
    requested: dict[Atom, bool] = {}

    def walk(part: Any, sign: bool) -> None:
        match part:
            case Atom():
                requested[part] = requested.get(part, False) or sign
            case Not(inner):
                walk(inner, not sign)
            case And(parts) | Or(parts) | Exactly(_, parts):
                for inner in parts:
                    walk(inner, sign)
            case Pairing(_, rows):
                for row in rows:
                    for inner in row:
                        walk(inner, sign)

    walk(goal.ground, True)
    found = []
    for atom in goal.atoms:
        sign = requested.get(atom, True)
        found.append((logic.text(atom if sign else Not(atom)), sign))
    return found
