"""`ig2mj rollout ENV`: plays episodes of an environment, and tells how they ended."""

from __future__ import annotations

from typing import Annotated

import tyro

AGENTS = ("zero", "random")


def run(
    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")],
    agent: str = "random",
    robot: str | None = None,
    grasping: str | None = None,
    engine: str | None = None,
    worlds: int = 1,
    episodes: int = 1,
    seed: int = 0,
    split: str = "train",
    pool_size: int = 0,
    paper_rl: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Play episodes of an environment, and tell how they ended.

    Args:
      env: CookingMeat, or ig2mj/CookingMeat-v0 (`ig2mj list-envs`).
      agent: who acts: zero (nothing moves) or random.
      robot: humanoid, fetch or turtlebot; default: the first that `ig2mj list-envs` names.
      grasping: mitten, assisted, sticky or physical; default: the task's own.
      engine: native, warp or jax; default: warp on a GPU, else native.
      worlds: how many play at once.
      episodes: how many are played, in all worlds together.
      seed: of start states and actions.
      split: start states: train or held_out.
      pool_size: start states; 0: as many as the split has.
      paper_rl: the thresholds that the paper's runs had.
      json: the last line is one JSON object.
    """
    import json as form
    import time

    import numpy as np

    from ig2mj.envs.registry import make
    from ig2mj.errors import Ig2mjError, UnknownNameError

    if agent not in AGENTS:
        raise UnknownNameError("agent", agent, AGENTS)
    if episodes < 1 or worlds < 1:
        raise Ig2mjError(f"--episodes {episodes}, --worlds {worlds}: at least one of each is needed")
    played = make(
        env, robot, worlds, engine, grasping, paper_rl=paper_rl, split=split, pool_size=pool_size or None
    )  # fmt: skip
    rng, shape = np.random.default_rng(seed), (worlds, *played.action_space.shape)
    state = played.reset(seed)
    returns, running = [], np.zeros(worlds)
    successes = in_hand = steps = 0
    began = time.monotonic()
    while len(returns) < episodes:
        action = rng.uniform(-1, 1, shape) if agent == "random" else np.zeros(shape)
        state = played.step_autoreset(state, action.astype(np.float32))
        running += np.asarray(state.reward)
        steps += worlds
        for world in np.flatnonzero(np.asarray(state.done))[: episodes - len(returns)]:
            returns.append(float(running[world]))
            successes += int(np.asarray(state.info["success"])[world])
            in_hand += int(np.asarray(state.info.get("success_in_hand", state.terminated))[world])
        running[np.asarray(state.done)] = 0.0
    metrics = played.metrics(state)
    result = {
        "env": played.task.name,
        "robot": played.robot,
        "grasping": played.grasping,
        "agent": agent,
        "paper_rl": paper_rl,
        "engine": played.core.engine.name,
        "worlds": worlds,
        "episodes": episodes,
        "success_rate": successes / episodes,
        "success_in_hand_rate": in_hand / episodes,
        "mean_return": float(np.mean(returns)),
        "steps_per_second": round(steps / (time.monotonic() - began), 1),
        "overflow": metrics["overflow"],
        "non_finite": metrics["not_finite"],
    }
    if json:
        print(form.dumps(result))
    else:
        print(
            f"{played.task.name}, {played.robot}, {agent}: {successes} of {episodes} episodes succeed, mean return "
            f"{result['mean_return']:.3f}, {result['steps_per_second']} agent steps/s"
        )
    played.close()
    return 0
