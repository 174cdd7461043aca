"""One process of a team of tests: `python team_process.py TASK OUT`, its place in the variables of its surroundings.

Run by tests/cluster/test_teams.py, which compares what the processes print.
"""

from __future__ import annotations

import json
import os
import pathlib
import sys
import time
from collections.abc import Callable
from typing import Any

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "learn"))

from ig2mj.cluster.process_topology import find_topology
from ig2mj.cluster.team import Team

WORLDS, LENGTH = 16, 8


def rollout(algorithm, start: int, stop: int):
    """Worlds `start` to `stop` of a rollout that is the same whoever asks."""
    import jax.numpy as jnp
    import numpy as np

    from ig2mj.learn.collect import Transition
    from ig2mj.learn.perception import Seen

    rng, p = np.random.default_rng(7), algorithm.perception

    def normal(*tail: int):
        return jnp.asarray(rng.standard_normal((LENGTH, WORLDS, *tail))[:, start:stop], jnp.float32)

    def seen() -> Seen:
        return Seen(normal(p.vector_size), jnp.zeros((LENGTH, stop - start, 0), jnp.uint8))

    ends = jnp.asarray(rng.random((LENGTH, WORLDS))[:, start:stop] < 0.1)
    raw = normal(2)
    extra = {"raw": raw, "chance": normal() - 3.0}
    return Transition(seen(), jnp.tanh(raw), extra, normal(), ends, jnp.zeros_like(ends), seen())


def gradient(team: Team) -> dict:
    """Adam's first moment after one update of PPO on the whole rollout: a tenth of the averaged, clipped gradient."""
    import jax
    import numpy as np
    from small_envs import PointMass

    from ig2mj.learn.perception import Perception
    from ig2mj.learn.ppo import PPO, PPOConfig
    from ig2mj.learn.several_devices import AXIS, ManyDevices

    config = PPOConfig(
        rollout_length=LENGTH, epochs=1, minibatches=1, actor_layers=(32, 32), critic_layers=(32, 32), lr=1e-3
    )
    perception, count = Perception(PointMass.observation_spaces), jax.device_count()
    key = jax.random.PRNGKey(3)
    if team.count == 1:
        ppo = PPO(perception, 2, config)
        learner, _, losses = jax.jit(ppo.learn)(
            ppo.init(key), ppo.buffer(WORLDS), rollout(ppo, 0, WORLDS), key, 0.5, np.bool_(True)
        )
    else:
        ppo = PPO(perception, 2, config, AXIS)
        step = ManyDevices(PointMass(WORLDS // count), ppo, jax.devices(), team)
        learner, memory = step.place(ppo.init(key), step.buffer())
        share = WORLDS // count
        own = jax.device_put(rollout(ppo, team.rank * share, (team.rank + 1) * share), jax.local_devices()[0])
        progress = 0.5 if team.rank == 0 else 0.25  # the largest counts
        learner, _, _, losses, _ = step.learn(learner, memory, [own], [{}], np.asarray(key), progress, True)
    mu = next(np.asarray(a) for a in jax.tree.leaves(learner.opt) if getattr(a, "ndim", 0) == 1)
    found = {"mean": learner.moments.mean, "var": learner.moments.var, "scale": losses["reward_scale"]}
    weights = np.concatenate([np.asarray(a).ravel() for a in jax.tree.leaves(learner.actor)])
    return {
        "gradient": (mu * 10).tolist(),
        "weights": weights.tolist(),
        **{k: np.asarray(v).tolist() for k, v in found.items()},
    }


def learn(team: Team, out: str, iterations: int, resume: bool, seconds: float = 0.0) -> dict:
    """A short run of SAC on a point mass; `seconds`: at least so long, to be killed meanwhile."""
    import jax
    from small_envs import PointMass

    from ig2mj.learn.perception import Perception
    from ig2mj.learn.sac import SAC, SACConfig
    from ig2mj.learn.several_devices import AXIS
    from ig2mj.learn.train import Run, train

    devices = jax.devices()
    config = SACConfig(
        utd_ratio=4, batch_size=64, buffer_size=4000, actor_layers=(32,), critic_layers=(32,), num_atoms=21
    )
    env = PointMass(32 // len(devices))
    sac = SAC(Perception(env.observation_spaces), 2, config, AXIS if len(devices) > 1 else None)
    minutes = seconds / 60 if seconds else 5.0
    run = Run(minutes, iterations=None if seconds else iterations, out=out, resume=resume, quiet=True)
    print("READY", flush=True)
    result = train(env, sac, run, devices=devices if len(devices) > 1 else (), team=team)
    return {"iteration": result.iteration, "env_steps": result.row["env_steps"], "stopped": result.stopped}


def turns(team: Team) -> dict:
    """Makes an environment as `ig2mj train` does, and one iteration on a point mass: who sampled, who compiled when."""
    import jax
    import numpy as np
    from small_envs import PointMass

    from ig2mj.envs.registry import make
    from ig2mj.learn.perception import Perception
    from ig2mj.learn.ppo import PPO, PPOConfig
    from ig2mj.learn.several_devices import AXIS, ManyDevices
    from ig2mj.tasks import pools

    sampled, sample = [], pools.make_pool
    pools.make_pool = lambda *given, **named: sampled.append(1) or sample(*given, **named)
    with team.turns():
        make("GraspingBook", None, 1, "native", pool_size=2)
    ppo = PPO(Perception(PointMass.observation_spaces), 2, PPOConfig(rollout_length=4, minibatches=1, epochs=1), AXIS)
    step = ManyDevices(PointMass(4), ppo, jax.devices(), team)
    learner, memory = step.place(ppo.init(jax.random.PRNGKey(0)), step.buffer())
    plays, times, compiled = step.begin(0), [], step._compiled

    def timed(act: Callable[..., Any]) -> Callable[..., Any]:
        def noted(*given: Any) -> Any:
            times.append(time.time())
            found = act(*given)
            times.append(time.time())
            return found

        return noted

    step._compiled = timed(compiled)
    act = step
    for k in range(2):
        learner, memory, plays, *_ = act(learner, memory, plays, np.asarray(jax.random.PRNGKey(k)), 0.0, True)
        act = timed(step)
    return {"sampled": len(sampled), "times": times}


def main() -> None:
    task, out = sys.argv[1:3]
    team = Team.join(find_topology(os.environ), patience=60.0)
    with team.together():
        if task == "gradient":
            found = gradient(team)
        elif task == "turns":
            found = turns(team)
        else:
            found = learn(team, out, int(task.split("-")[1]), "resume" in task, 60.0 if "long" in task else 0.0)
    print("RESULT" + json.dumps({"rank": team.rank, **found}), flush=True)


if __name__ == "__main__":
    main()
