"""Episodes of a planning problem in physics: worlds with the robot at its start, doors open or shut."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ig2mj.agents.registry import make_robot
from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.problem import Problem, start_of
from ig2mj.planning.stage import CoreStage
from ig2mj.planning.starts import open_doors, start_place
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import Row
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.simulation.robots import put_row
from ig2mj.simulation.simulation import Simulation
from ig2mj.worlds.pool import Pool

DOORS_SETTLE = 15
"""Control steps after doors were opened."""


def scene_with_robot(problem: Problem, robot: str, pool: Pool | None) -> Scene:
    """The problem's scene with the robot on free floor near what the goal is about.

    Raises:
      UnknownNameError: no such robot. EngineError: no floor is free.
    """
    query = SceneQuery(problem.scene)
    if pool is not None:
        query.load(start_of(pool, 0)[0])
    names = problem.scene.object_names
    near = [a for atom in problem.goal.atoms for a in atom.arguments if a in names and not _is_floor(problem, a)]
    x, y = start_place(problem.scene, query.view, list(dict.fromkeys(near)))
    body: Any = make_robot(robot)
    return load_scene(problem.scene.folder, agents=[body.at(x, y, 0.0)], objects=problem.objects)


def _is_floor(problem: Problem, name: str) -> bool:
    return bool(problem.scene.tables.object_is_floor[problem.scene.object_index(name)])


def simulated_episodes(
    problem: Problem,
    robot: str,
    pool: Pool | None,
    numbers: Sequence[int],
    seed: int = 0,
    doors_open: bool = True,
) -> Iterator[tuple[int, PhysicsRung, Simulation]]:
    """Rungs of one world each, one after another, in one simulation that can be recorded and rendered.

    Args:
      numbers: of episodes; one without a row of the pool is left out.
      doors_open: doors between rooms that the goal does not name stand open at the start.

    Raises:
      As `scene_with_robot`, and PlanningError: the robot's motion cannot be planned.
    """
    scene = scene_with_robot(problem, robot, pool)
    simulation = Simulation(scene, seed=seed, grasping="assisted")
    query = SceneQuery(scene)
    write = _doors(problem, scene) if doors_open else None
    for number in numbers:
        if pool is not None and number >= pool.size:
            continue
        simulation.reset()
        if pool is not None:
            put_row(simulation, Row(*start_of(pool, number)))
        if write is not None:
            simulation._write(write)
            simulation.step(count=DOORS_SETTLE)
        rung = simulation.agent.rung
        yield number, PhysicsRung(rung.stage, seed, number, query), simulation


def batched_episodes(
    problem: Problem,
    robot: str,
    pool: Pool | None,
    numbers: Sequence[int],
    worlds: int,
    seed: int = 0,
    doors_open: bool = True,
) -> Iterator[tuple[list[int], PhysicsRung]]:
    """Rungs of several worlds each; see `simulated_episodes`."""
    scene = scene_with_robot(problem, robot, pool)
    query = SceneQuery(scene)
    write = _doors(problem, scene) if doors_open else None
    numbers = [n for n in numbers if pool is None or n < pool.size]
    for k in range(0, len(numbers), worlds):
        chosen = list(numbers[k : k + worlds])
        stage = CoreStage(
            scene, NativeEngine(scene, len(chosen)), starts=None if pool is None else pool.rows(np.array(chosen))
        )
        if write is not None:
            stage.write(write)
        yield chosen, PhysicsRung(stage, seed, chosen[0], query)


def _doors(problem: Problem, scene: Scene) -> Write | None:
    named = {a for atom in problem.goal.atoms for a in atom.arguments}
    return open_doors(scene, named)
