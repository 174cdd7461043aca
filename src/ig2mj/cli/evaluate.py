"""`ig2mj evaluate POLICY`: how often a policy succeeds from states it has not seen."""

from __future__ import annotations

from typing import Annotated

import tyro

WORLDS = {"native": 8}
"""So many worlds unless another number is asked for; on the others as many as episodes, up to `PURE_WORLDS`."""

PURE_WORLDS = 1000


def run(
    policy: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")],
    episodes: int = 1000,
    split: str = "held_out",
    engine: str | None = None,
    worlds: int = 0,
    robot: str | None = None,
    grasping: str | None = None,
    pool_size: int = 0,
    drawn: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Tell how often a policy succeeds, each start state played once.

    Args:
      policy: a file that `ig2mj train` wrote, or the name of one that ships.
      episodes: how many; the start states of the split are played in their order.
      split: start states: held_out or train.
      engine: native, warp or jax; default: warp on a GPU, else native.
      worlds: how many play at once; 0: one for each episode, 1000 at most, natively 8.
      robot: only for a policy of this robot (its card says which).
      grasping: only for a policy of this way of grasping.
      pool_size: start states; 0: as many as the split has.
      drawn: actions are drawn from the policy's distribution, as in training, instead of its middle.
      json: print one JSON object.
    """
    import json as form

    import jax

    from ig2mj.envs.registry import make
    from ig2mj.envs.rollout import play
    from ig2mj.errors import Ig2mjError
    from ig2mj.learn.evaluate import acting, summary
    from ig2mj.learn.policies import Policy
    from ig2mj.learn.shipped import find_policy

    if episodes < 1:
        raise Ig2mjError(f"--episodes {episodes}: at least one is needed")
    file = find_policy(policy)
    loaded = Policy.load(file)
    depends = loaded.card["depends"]
    if engine is None:
        engine = "warp" if jax.default_backend() == "gpu" else "native"
    count = worlds or min(episodes, WORLDS.get(engine, PURE_WORLDS))
    env = make(
        depends["task"],
        robot or depends["robot"],
        count,
        engine,
        grasping or depends["grasping"],
        observations=loaded.observations,
        paper_rl=loaded.card.get("paper_rl", False),
        split=split,
        pool_size=pool_size or None,
    )
    played = play(env, acting(loaded, env, file, drawn=drawn), episodes, in_order=True)
    found, metrics = summary(played), env.metrics(played.state)
    result = {
        "env": env.task.name,
        "robot": env.robot,
        "grasping": env.grasping,
        "agent": str(policy),
        "weights": loaded.weights_digest,
        "paper_rl": loaded.card.get("paper_rl", False),
        "split": split,
        "drawn": drawn,
        "engine": engine,
        "worlds": count,
        **found,
        "overflow": metrics["overflow"],
        "non_finite": metrics["not_finite"],
    }
    if json:
        print(form.dumps(result))
    else:
        low, high = found["success_low"], found["success_high"]
        print(
            f"{env.task.name}, {env.robot}, {env.grasping}: {found['success_rate']:.1%} of {episodes} episodes succeed "
            f"({low:.1%} to {high:.1%} with 95 % confidence), mean return {found['mean_return']:.3f}"
        )
    return 0
