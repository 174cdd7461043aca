"""Copies of an environment's states: forks, and files."""

from __future__ import annotations

import dataclasses
import os
import typing
from typing import Any

from ig2mj.engine.base import EngineHolder
from ig2mj.envs.checks import checked_state
from ig2mj.envs.state import EnvState
from ig2mj.envs.state_files import load_state, save_state
from ig2mj.worlds.core import Core


class StateCopies(EngineHolder):
    """Part of `Environment`. Attributes: core: what steps its worlds."""

    NO_COPY = (
        "an environment holds its engine, and is neither copied nor pickled: ig2mj.make makes another one, in the"
        " process that uses it; env.fork(state) copies a state, env.save(state, FILE) keeps one"
    )

    core: Core

    def check(self, state: EnvState) -> None:
        """Raises StaleStateError: the state is stale, which is not known while tracing. ActionError: it is no state."""
        self.core.check(checked_state(state).batch)

    def fork(self, state: EnvState) -> EnvState:
        """An independent copy of a state, for planners and branches: `state` stays valid, and both give the same
        results for the same actions. Not for compiled programs, in which states are values.

        Raises:
          StaleStateError: the state is stale.
        """
        self.check(state)
        return self.core.engine.copied(state)

    def save(self, state: EnvState, file: str | os.PathLike) -> None:
        """Writes all worlds of a state to an `.npz` file (arrays only, no pickle), for `load`.

        Raises:
          StaleStateError: the state is stale. InputError: the file cannot be written.
        """
        save_state(typing.cast(Any, self), state, file)

    def load(self, file: str | os.PathLike) -> EnvState:
        """The state that `save` wrote, on any machine and engine; it continues as the saved one would have.

        Raises:
          InputError: the file is missing or damaged, or of another scene, task, robot, way of grasping, observations or
            number of worlds; it names the pair.
        """
        return load_state(typing.cast(Any, self), file)

    def current(self, state: EnvState) -> EnvState:
        """A state to reset after a step that did not return (Ctrl-C): on the native engine with the worlds as that step
        left them. Its observations are older than its physics."""
        world = dataclasses.replace(state.batch.world, physics=self.core.engine.current(state.batch.world.physics))
        return dataclasses.replace(state, batch=dataclasses.replace(state.batch, world=world))
