"""`ig2mj view --policy NAME`: shows a trained policy, in MuJoCo's window or as a video."""

from __future__ import annotations

import pathlib

ROWS = 32
"""Start states to begin with: the first ones of the held-out split, since all of them take a minute to sample."""


def view_policy(name: str, video: pathlib.Path | None, row: int, paused: bool) -> None:
    """Shows a policy in one native world, at held-out start states.

    Args:
      name: of a shipped policy, or a run's folder or file. video: video or film strip of one episode, without a window.
      row: of the held-out start states, to begin with.

    Raises:
      UnknownNameError, InputError: there is no such policy. Ig2mjError: no row has this number.
    """
    import sys

    import numpy as np

    from ig2mj.cli.common.files import check_video
    from ig2mj.envs.registry import make
    from ig2mj.errors import Ig2mjError
    from ig2mj.learn.evaluate import acting
    from ig2mj.learn.policies import Policy, looks_of, objects_of, robot_of
    from ig2mj.learn.shipped import find_policy
    from ig2mj.showcase.film_strip import ENDINGS
    from ig2mj.tasks.custom.files import refuse_unknown
    from ig2mj.tasks.pools import COUNT
    from ig2mj.viewer.acting import BETWEEN, ActingWorld
    from ig2mj.viewer.interactive import check_display, launch

    if not 0 <= row < COUNT["held_out"]:
        raise Ig2mjError(f"--row {row}: the held-out start states are 0 to {COUNT['held_out'] - 1}")
    file = find_policy(name)
    if video is None:
        check_display()
    else:
        check_video(video, ENDINGS)
    policy = Policy.load(file)
    depends = policy.card["depends"]
    refuse_unknown(depends["task"], depends.get("task_file"), file)
    env = make(
        depends["task"],
        robot_of(policy.card),
        1,
        "native",
        depends["grasping"],
        observations=policy.observations,
        relaxed_thresholds=policy.card.get("paper_rl", False),
        split="held_out",
        pool_size=max(ROWS, row + 1),
        objects=objects_of(policy, file),
        looks=looks_of(policy),
    )
    act = acting(policy, env, file)
    if video is not None:
        from ig2mj.showcase.episode_video import EpisodeVideo

        film, state = EpisodeVideo(video, env), env.start_from(np.array([row]))
        try:
            film.see(state)
            while not bool(np.asarray(state.done)[0]):
                state = env.step(state, act(state))
                film.see(state)
        finally:
            film.close()
        print(f"wrote {video} ({'success' if bool(np.asarray(state.info['success'])[0]) else 'no success'})")
        return
    world = ActingWorld(env, act, row)
    launch(world, step_time=env.period / BETWEEN, paused=paused)
    print(f"{world.successes} of {world.episodes} episodes succeeded", file=sys.stderr)
