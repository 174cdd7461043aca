"""Every policy that ships acts as it did when its actions were recorded.

`data/shipped_actions.json` holds actions [step][world][number] on made-up observations. Policies that are added or
replaced need new rows: `python tests/learn/test_shipped_policies_act_as_recorded.py` writes the file again.
"""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from ig2mj.envs.observations import Space
from ig2mj.learn.policies import Policy, perception_of
from ig2mj.learn.shipped import CHECKOUT

FILE = Path(__file__).parent / "data" / "shipped_actions.json"
WORLDS, STEPS, SIDE = 2, 4, 128
BEGINS = np.array([[True, True], [False, False], [False, False], [False, True]])


def observations(policy: Policy) -> tuple[dict[str, Space], list[dict[str, np.ndarray]]]:
    """Spaces of an environment for this policy, and what it observes there in `STEPS` steps."""
    depends = policy.card["depends"]
    sizes, images = depends["vector"], depends["picture"] is not None
    spaces = {name: Space((size,), np.float32, -np.inf, np.inf) for name, size in sizes.items()}
    if images:
        spaces["rgb"] = Space((SIDE, SIDE, 3), np.uint8, 0.0, 255.0)
        spaces["depth"] = Space((SIDE, SIDE, 1), np.float32, 0.0, 10.0)
    rng = np.random.default_rng(zlib.crc32(depends["task"].encode()))
    memory = policy.card["net"].get("recall") or {"grips": []}
    rows = []
    for step in range(STEPS):
        vector = policy.mean + policy.deviation * rng.normal(size=(WORLDS, len(policy.mean)))
        vector[:, memory["grips"]] = 1.0 if step in (1, 2) else -1.0
        ends = np.cumsum(list(sizes.values()))
        parts = np.split(vector.astype(np.float32), ends[:-1], axis=1)
        obs = dict(zip(sizes, parts, strict=True))
        if images:
            obs["rgb"] = rng.integers(0, 256, (WORLDS, SIDE, SIDE, 3)).astype(np.uint8)
            obs["depth"] = rng.uniform(0.0, 4.0, (WORLDS, SIDE, SIDE, 1)).astype(np.float32)
        rows.append(obs)
    return spaces, rows


def actions(file: Path, *, sampled: bool) -> np.ndarray:
    """Of every step, [STEPS, WORLDS, n]."""
    policy = Policy.load(file)
    spaces, rows = observations(policy)
    play: Any = jax.jit(policy.player(perception_of(policy, spaces), sampled=sampled))
    kept = np.zeros((WORLDS, 0 if policy.memory is None else policy.memory.size), np.float32)
    found = []
    for step, obs in enumerate(rows):
        action, kept = play(obs, kept, BEGINS[step], jax.random.PRNGKey(step) if sampled else None)
        found.append(np.asarray(action))
    return np.stack(found)


def names() -> list[str]:
    return sorted(f.stem for f in CHECKOUT.glob("*.npz"))


def test_every_policy_that_ships_is_recorded():
    assert names() == sorted(json.loads(FILE.read_text()))


@pytest.mark.parametrize("name", names())
def test_a_policy_that_ships_acts_as_recorded(name):
    recorded = json.loads(FILE.read_text())[name]
    np.testing.assert_allclose(actions(CHECKOUT / f"{name}.npz", sampled=False), recorded["mode"], atol=1e-4)


@pytest.mark.parametrize("name", ["CookingMeat", "SlicingFruit-fetch"])
def test_sampled_actions_are_those_recorded_for_the_same_keys(name):
    recorded = json.loads(FILE.read_text())[name]
    np.testing.assert_allclose(actions(CHECKOUT / f"{name}.npz", sampled=True), recorded["sampled"], atol=1e-4)


if __name__ == "__main__":
    rows = {}
    for name in names():
        file = CHECKOUT / f"{name}.npz"
        both = {"mode": actions(file, sampled=False), "sampled": actions(file, sampled=True)}
        rows[name] = {kind: np.round(a.astype(float), 6).tolist() for kind, a in both.items()}
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(json.dumps(rows) + "\n")
