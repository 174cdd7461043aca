"""`ig2mj solve HOME --script FILE`: requests to primitives, carried out in order."""

from __future__ import annotations

import json as json_module
import pathlib
import sys
import time
from collections.abc import Sequence


def run_script(
    home: str, file: pathlib.Path, robot: str, seed: int, objects: Sequence[str] = (), json: bool = False
) -> int:
    """Carries out a script in physics until one of its requests fails; the exit status is 0 if none does.

    Args:
      home: name or folder. file: see `ig2mj.planning.words.read_script`. robot: starts near what it names first.
      json: the figures of `ig2mj solve --json`; q is the share of requests that were carried out.

    Raises:
      InputError, UnknownNameError, PlanningError: the script, before anything is carried out.
    """
    from ig2mj.agents.registry import make_robot
    from ig2mj.cli.common.objects import load_home
    from ig2mj.cli.common.printing import make_table, stdout_console
    from ig2mj.cli.common.solving import COLUMNS, line_of, rows_of
    from ig2mj.planning.solver import EpisodeResult, StepRecord, summary
    from ig2mj.planning.starts import start_place
    from ig2mj.planning.words import read_script
    from ig2mj.sampling.query import SceneQuery
    from ig2mj.scene.scene import load_scene
    from ig2mj.simulation.simulation import Simulation

    began = time.monotonic()
    steps = read_script(file)
    bare = load_home(home, objects)
    rooms = bare.tables.room_names
    for step in steps:
        for name in step.things:
            if name not in rooms:
                bare.object_index(name)
    near = [n for n in steps[0].things if n not in rooms] if steps else []
    x, y = start_place(bare, SceneQuery(bare).view, near)
    scene = load_scene(home, [make_robot(robot).at(x, y, 0.0)], objects)
    simulation = Simulation(scene, grasping="assisted", seed=seed)
    agent, records = simulation.robots[scene.tables.agent_names[0]], list[StepRecord]()
    for step in steps:
        since = time.monotonic()
        outcome = agent.do(step.primitive, *step.arguments)
        records.append(StepRecord(step, outcome, time.monotonic() - since))
        print(f"{len(records)}. {line_of(records[-1])}", file=sys.stderr, flush=True)
        if not outcome.done:
            break
    done = sum(r.outcome.done for r in records)
    success = done == len(steps)
    seconds, simulated = time.monotonic() - began, float(sum(r.outcome.time for r in records))
    result = EpisodeResult(
        success, done / len(steps) if steps else 1.0, tuple(records), 0, len(steps), seconds, simulated
    )
    if json:
        print(json_module.dumps(summary([result], seconds)))
        return 0 if success else 1
    console = stdout_console()
    console.print(make_table(f"{file.name} in {scene.name}", COLUMNS, rows_of(records), console.width))
    print(f"{done} of {len(steps)} requests carried out in {simulated:.1f} s of simulated time, {seconds:.1f} s in all")
    return 0 if success else 1
