"""`ig2mj play ENV`: drive a robot in an environment by keyboard and mouse."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot

STEPS_PER_SECOND = 30

FOREVER = 10**9
"""Steps of an episode: a person's does not end by itself."""


def run(
    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")],
    robot: str | None = None,
    own: Own = NONE,
    grasping: str | None = None,
    seed: int = 0,
    pool_size: int = 8,
    object: AddedObjects = (),
    record: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    keys: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Drive a robot in an environment by keyboard and mouse, in MuJoCo's viewer.

    In the window: Enter lists the keys. Independently of the robot, select an object by double-click, drag it with
    Ctrl and the right button by a spring of at most 100 N, and push it with P, as in iGibson's viewer.

    Args:
      env: environment, e.g. CookingMeat or ig2mj/CookingMeat-v0 (`ig2mj list-envs` names them), or a task of a file of
        yours: my_tasks.py:MugToTable.
      robot: {robots}, or a folder that `ig2mj convert robot` wrote; default: the task's first robot.
      grasping: assisted, sticky, physical or mitten (docs/guide/environments.md); default: assisted, for robots with
        hands.
      seed: random seed of the start states.
      pool_size: number of start states; an activity's are sampled first, which takes a while.
      object: {object}.
      record: HDF5 file to record all runs to, for `ig2mj demos replay`; it lacks what the mouse does to objects.
      keys: print the keys and exit.
    """
    import numpy as np

    from ig2mj.viewer.play.keys import BINDINGS

    if keys:
        for binding in BINDINGS:
            print(f"{binding.shown:16} {binding.command}")
        return 0
    from ig2mj.cli.common.files import check_output
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.envs.registry import find_task, make
    from ig2mj.tasks.navigation.task import NavigationTask
    from ig2mj.viewer.interactive import check_display
    from ig2mj.viewer.play.session import PlaySession, launch

    task = find_task(env)
    robot = choose_robot(robot, own)
    check_display()
    if record is not None:
        check_output(record)
    if grasping is None:
        grasping = "physical" if isinstance(task, NavigationTask) else "assisted"
    made = make(
        env,
        robot,
        1,
        "native",
        grasping,
        pool_size=pool_size,
        whole_actions=True,
        period=1 / STEPS_PER_SECOND,
        objects=object,
    ).with_horizon(FOREVER)
    note_changes(made.scene, object)
    made.step(made.reset(seed), np.zeros((1, *made.action_space.shape), np.float32))  # compiles before the window opens
    if record is not None:
        from ig2mj.demos import record as recorded

        made = recorded(made, record, past_success=True)
    try:
        session = PlaySession(made, seed)
        launch(session)
    finally:
        made.close()
    print(
        f"{made.task.name}: the goal was reached {session.successes} times"
        if session.successes != 1
        else f"{made.task.name}: the goal was reached once"
    )
    return 0
