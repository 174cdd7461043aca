"""Plays a network of three layers, cloned elsewhere, on 32 held-out start states: TASK FILE.npz."""

import json
import sys

import numpy as np

import ig2mj
from ig2mj.envs.rollout import play

task, file = sys.argv[1:]
weights = np.load(file)
env = ig2mj.make(task, "humanoid", 8, "native", split="held_out", pool_size=32)


def act(state):
    x = (np.concatenate([np.asarray(rows) for rows in state.obs.values()], axis=1) - weights["mean"]) / weights["std"]
    for k in range(2):
        x = np.maximum(x @ weights[f"w{k}"] + weights[f"b{k}"], 0)
    return np.tanh(x @ weights["w2"] + weights["b2"])


ends = play(env, act, 32, in_order=True)
print(json.dumps({"episodes": len(ends.success), "success": sum(ends.success)}))
