"""`play`: episodes of an environment, and how they ended.

Axis: W worlds.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping

import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment, EnvState

Act = Callable[[EnvState], Array]
"""Actions [W, n] from the state of all worlds."""

Watch = Callable[[EnvState], None]
"""Called with the state at the start of episodes and after every step."""


@dataclasses.dataclass(frozen=True)
class Played:
    """Of every episode, in the order in which they ended (or of the pool's rows, where those were played in order).

    Attributes:
      success, success_in_hand: how it ended. total: its return.
      lifted_by_all: success, and both hands held the object when it last left the floor; None where one hand acts.
      steps: agent steps that were taken in all worlds together.
      steps_per_second: of them on the wall, without the first step, which compiles.
      state: of all worlds at the end.
    """

    success: list[bool]
    success_in_hand: list[bool]
    lifted_by_all: list[bool] | None
    total: list[float]
    steps: int
    steps_per_second: float
    state: EnvState


def play(
    env: Environment,
    act: Act,
    episodes: int,
    seed: int = 0,
    in_order: bool = False,
    watch: Watch | None = None,
    first: int = 0,
) -> Played:
    """Plays episodes.

    Args:
      act: who acts. seed: of the start states that are drawn.
      in_order: begin with the rows of the environment's pool, each once; again from the first where there are fewer.
        Where an episode is over actions are zero until all are.
      first: of these rows.
    """
    return _in_order(env, act, episodes, seed, watch, first) if in_order else _drawn(env, act, episodes, seed, watch)


def _drawn(env: Environment, act: Act, episodes: int, seed: int, watch: Watch | None) -> Played:
    state = env.reset(seed)
    _look(watch, state)
    success, in_hand, lifted, total = [], [], [], []
    lifts = Lifts(state.info, env.num_worlds)
    running, steps, pace = np.zeros(env.num_worlds), 0, Pace()
    while len(total) < episodes:
        state = env.step_autoreset(state, act(state))
        _look(watch, state)
        running += np.asarray(state.reward)
        steps += env.num_worlds
        pace.stepped(env.num_worlds)
        done, won = np.asarray(state.done), np.asarray(state.info["success"])
        lifts.see(state.info, done, np.ones_like(done))
        for world in np.flatnonzero(done)[: episodes - len(total)]:
            total.append(float(running[world]))
            success.append(bool(won[world]))
            in_hand.append(bool(np.asarray(state.info.get("success_in_hand", won))[world]))
            lifted.append(bool(won[world] & lifts.by_all[world]))
        running[done] = 0.0
    return Played(success, in_hand, lifted if lifts.told else None, total, steps, pace.steps_per_second(), state)


def _in_order(env: Environment, act: Act, episodes: int, seed: int, watch: Watch | None, start: int = 0) -> Played:
    size, worlds = env.core.starts.pool.size, env.num_worlds
    success, in_hand, lifted, total = [], [], [], []
    steps, pace, state, lifts = 0, Pace(), None, None
    for first in range(0, episodes, worlds):
        state = env.start_from((start + first + np.arange(worlds)) % size, seed)
        _look(watch, state)
        lifts = Lifts(state.info, worlds)
        going, won, holding = np.ones(worlds, bool), np.zeros(worlds, bool), np.zeros(worlds, bool)
        running = np.zeros(worlds)
        while going.any():
            state = env.step(state, resting(act(state), going))
            _look(watch, state)
            steps += worlds
            running += np.where(going, np.asarray(state.reward), 0.0)
            pace.stepped(worlds)
            ends = going & np.asarray(state.done)
            won |= ends & np.asarray(state.info["success"])
            holding |= ends & np.asarray(state.info.get("success_in_hand", state.info["success"]))
            lifts.see(state.info, np.asarray(state.done), going)
            going &= ~ends
        count = min(worlds, episodes - first)
        success += won[:count].tolist()
        in_hand += holding[:count].tolist()
        lifted += (won & lifts.by_all)[:count].tolist()
        total += running[:count].tolist()
    assert state is not None and lifts is not None
    return Played(success, in_hand, lifted if lifts.told else None, total, steps, pace.steps_per_second(), state)


def resting(action: Array, going: np.ndarray) -> Array:
    """Zeros where the episode is over. A world waits there for the others, and a policy that was trained up to the end
    of episodes only would go on: a knife is pressed through the table with all force, until nothing is finite."""
    where = np.where if isinstance(action, np.ndarray) else jnp.where
    return where(going[:, None], action, np.float32(0.0))


class Pace:
    """How fast agent steps are taken, without the first, which compiles for seconds."""

    def __init__(self) -> None:
        self._steps, self._began = 0, math.nan

    def stepped(self, worlds: int) -> None:
        """After a step of so many worlds, whose results are there."""
        if math.isnan(self._began):
            self._began = time.monotonic()
        else:
            self._steps += worlds

    def steps_per_second(self) -> float:
        """0 where there was one step at most."""
        return self._steps / (time.monotonic() - self._began) if self._steps else 0.0


class Lifts:
    """Whether all acting hands held a task's first object when it left the floor, for two hands.

    Attributes:
      told: the environment tells of it. by_all: [W], at the last time it left the floor; False before that.
    """

    def __init__(self, info: Mapping[str, Array], num_worlds: int):
        """`info`: at the start of episodes."""
        self.told = "off_floor" in info
        self.by_all = np.zeros(num_worlds, bool)
        self._off = np.array(info["off_floor"]) if self.told else self.by_all

    def see(self, info: Mapping[str, Array], done: np.ndarray, going: np.ndarray) -> None:
        """After a step.

        Args:
          done: [W], episodes that ended with it. going: [W], whose episodes had not ended before; others keep what was
            found.
        """
        if not self.told:
            return
        off, held = np.array(info["off_floor"]), np.asarray(info["held_by_all"])
        self.by_all = np.where(off & ~self._off & going, held, self.by_all)
        self._off = off & ~done  # a new episode begins on the floor


def _look(watch: Watch | None, state: EnvState) -> None:
    if watch is not None:
        watch(state)
