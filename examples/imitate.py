"""From recorded demonstrations to a cloned policy: `python examples/imitate.py GraspingBook`, or a file."""

import sys

import jax
import jax.numpy as jnp
import numpy as np
import optax

import ig2mj
from ig2mj.demos import Recording, Replayer, find_recording
from ig2mj.demos.observing import observe
from ig2mj.envs.rollout import play


def demonstrations(name):  # observations and actions of all steps, and the environment they were recorded in
    seen, actions = [], []

    def keep(_number, run, obs):
        label = "steps/label" if "label" in run.step_names else "steps/action"
        seen.append(np.concatenate([rows[:-1] for rows in obs.values()], axis=1))
        actions.append(run.all_rows(label))

    with Recording(find_recording(name)) as recording:
        replayer = Replayer(recording)  # takes every action again, to see what there was to see
        observe(replayer, keep, exact=False)
    return np.concatenate(seen), np.concatenate(actions), replayer.env


def network(weights, x):
    for w, b in weights[:-1]:
        x = jax.nn.relu(x @ w + b)
    return jnp.tanh(x @ weights[-1][0] + weights[-1][1])


def clone(seen, actions, steps=6000, batch=256):  # a function from observations [W, n] to actions
    mean, std, rng = seen.mean(0), seen.std(0) + 1e-3, np.random.default_rng(0)
    sizes = zip((seen.shape[1], 256, 256), (256, 256, actions.shape[1]), strict=True)
    weights = [(jnp.float32(rng.normal(0, a**-0.5, (a, b))), jnp.zeros(b)) for a, b in sizes]
    adam = optax.adam(optax.cosine_decay_schedule(1e-3, steps))

    @jax.jit
    def update(weights, state, x, y):
        slope = jax.grad(lambda w: jnp.square(network(w, x) - y).mean())(weights)
        change, state = adam.update(slope, state)
        return optax.apply_updates(weights, change), state

    state = adam.init(weights)
    for _ in range(steps):
        rows = rng.integers(len(seen), size=batch)
        weights, state = update(weights, state, (seen[rows] - mean) / std, actions[rows])
    return jax.jit(lambda obs: network(weights, (obs - mean) / std))


if __name__ == "__main__":
    seen, actions, env = demonstrations(sys.argv[1])
    policy = clone(seen, actions)
    env = ig2mj.make(env.task, env.robot, 8, "native", env.grasping, split="held_out", pool_size=32)
    ends = play(env, lambda s: policy(np.concatenate([*map(np.asarray, s.obs.values())], axis=1)), 32, in_order=True)
    print(f"{env.task.name}: cloned from {len(seen)} steps; {sum(ends.success)} of 32 held-out episodes succeed")
