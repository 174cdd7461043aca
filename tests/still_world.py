"""Planned worlds of the humanoid in which nothing acts: what plans can be asked of a scene as it stands."""

from __future__ import annotations

import types

import numpy as np

from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.domain import Domain
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.world import PlannedWorld
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import Scene
from ig2mj.worlds.rules import Rules


def still_world(scene: Scene, query: SceneQuery) -> PlannedWorld:
    """The world of a scene with one robot, as a query of it is now."""
    start, model = query.save(), Rules.of_scene(scene).model
    stage = types.SimpleNamespace(
        scene=scene,
        view=query.view,
        model=model,
        states=None,
        snapshot=lambda world: start,
        agent=0,
        controller=None,
        num_worlds=1,
        by_friction=False,
        act=print,
        ended=print,
    )
    body = body_of(scene, scene.agents[0].controller(scene.tables, 0, 0.1))
    motion, rng = MotionPlanner(scene), np.random.default_rng(0)
    return PlannedWorld(stage, body, Domain(model, 2), motion, SceneQuery(scene), 0, rng)
