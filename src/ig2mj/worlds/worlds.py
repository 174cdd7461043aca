"""`Worlds`: a batch of worlds of one home, to train in.

    worlds = ig2mj.Worlds("small_home", 1024, goal="(cooked fish_0)")
    batch = worlds.start(seed=0)
    batch, status = worlds.step(batch)             # status.holds: Bool[1024]
    batch = worlds.reset(batch, status.holds)

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import os
from typing import Any

from ig2mj.agents.base import Controller, Robot
from ig2mj.agents.grasping import Grasping
from ig2mj.engine.base import Engine
from ig2mj.engine.registry import check_options, choose_engine, make_engine
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.predicates.logic import Expression
from ig2mj.process import entry_point
from ig2mj.scene.scene import Objects, Scene, scene_with
from ig2mj.states.model import DEFAULTS
from ig2mj.states.options import StateOptions
from ig2mj.worlds.core import Core
from ig2mj.worlds.face import Face
from ig2mj.worlds.hands import check_grasping
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.rules import Rules


@entry_point
class Worlds(Face):
    """Many worlds of a home: a core with a scene. Its verbs are those of `Face`.

    Attributes:
      scene: the household. core: what steps it, with `step_fn` and `reset_fn` for programs of your own.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike,
        num_worlds: int = 1,
        engine: str | Engine | None = None,
        *,
        goal: CompiledExpression | Expression | str | None = None,
        pool: Pool | None = None,
        states: StateOptions = DEFAULTS,
        grasping: str | Grasping = "physical",
        objects: Objects = (),
        **options: Any,
    ):
        """Makes the worlds; `start` puts them at their start.

        Args:
          scene: a loaded scene, or what `load_scene` takes. The robots it was loaded with take the actions of `step`.
          engine: an engine's name, or an engine made for this scene with `num_worlds` worlds; None: "warp" where JAX
            has a GPU, else "native".
          goal: evaluated at the end of every step. Without one, nothing is ever reached.
          pool: what episodes start from (`ig2mj sample` makes one); None: from the scene's initial state.
          states: how extended states behave.
          grasping: how the robots' hands hold, a name of `ig2mj.agents.grasping.MODES`: "physical" (by friction alone),
            "assisted" or "sticky"; or a `Grasping` of this scene, which "mitten" needs with its targets.
          objects: what is added to the home (see `load_scene`); not to a scene that is loaded.
          options: go to the engine, where it is given by name.

        Raises:
          EngineError: the engine cannot run this scene. UnknownNameError: no such mode of grasping, or option.
          Others: as
          `load_scene` and `compile_expression`.
        """
        engine = choose_engine(engine)
        self.scene = scene_with(scene, objects)
        check_options("Worlds", options, engine, Worlds)
        if isinstance(engine, str):
            engine = make_engine(engine, self.scene, num_worlds, **options)
        rules = Rules.of_scene(self.scene, states).with_goal(goal)
        controllers = controllers_of(self.scene, engine.substeps * engine.timestep)
        self.core = Core(engine, rules, pool, controllers, grasping_of(engine, grasping), True)

    def __repr__(self) -> str:
        engine = self.core.engine
        number = engine.num_worlds
        count = f"{number} world{'s' * (number != 1)}"
        return f"Worlds('{self.scene.name}', {count}, engine '{engine.name}')"


def controllers_of(scene: Scene, period: float) -> list[Controller]:
    """The controllers of the scene's robots, in the order of its agents; `period`: seconds between two actions."""
    robots = [(k, agent) for k, agent in enumerate(scene.agents) if isinstance(agent, Robot)]
    return [robot.controller(scene.tables, k, period) for k, robot in robots]


def grasping_of(engine: Engine, grasping: str | Grasping) -> Grasping | None:
    """The rule of grasping of that name for the engine's scene, or that was made; None: by friction alone.

    Raises:
      UnknownNameError: there is no such mode. EngineError: the engine cannot hold by that rule.
    """
    made = Grasping(engine.scene, grasping) if isinstance(grasping, str) else grasping
    check_grasping(engine, made)
    return made if made.active else None
