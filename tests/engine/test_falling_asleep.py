"""Trees fall asleep as MuJoCo Warp puts them to sleep: the same rings, the same velocities at rest."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from ig2mj.engine.warp.patches import pins

pytestmark = pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}")
if not pins.obstacles():
    from mujoco.mjx.third_party.mujoco_warp._src import sleep as upstream

    from ig2mj.engine.warp.patches import sleeping

WORLDS, TREES = 64, 12


@pytest.mark.slow
def test_rings_and_velocities_are_those_of_upstream(kernel_device):
    rng = np.random.default_rng(0)
    dofs = rng.integers(1, 7, TREES)
    starts = np.concatenate([[0], np.cumsum(dofs)[:-1]])
    islands = rng.integers(0, 5, WORLDS)
    member = rng.integers(-1, 5, (WORLDS, TREES))
    may_sleep = rng.integers(0, 2, (WORLDS, TREES))
    asleep = rng.integers(-3, TREES, (WORLDS, TREES))
    moving = rng.normal(size=(WORLDS, int(dofs.sum()))).astype(np.float32)
    results = []
    for kernel, dim in ((sleeping._fall_asleep, (WORLDS, TREES)), (upstream._build_cycles, WORLDS)):
        ring, qvel, qacc = wp.array(asleep, dtype=int), wp.array(moving), wp.array(moving)
        fixed = [wp.array(a, dtype=int) for a in (starts, dofs, islands, member, may_sleep)]
        wp.launch(kernel, dim=dim, inputs=[TREES, *fixed], outputs=[ring, qvel, qacc])
        results.append([a.numpy() for a in (ring, qvel, qacc)])
    for ours, theirs in zip(*results, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    ring = results[0][0]
    assert (ring != asleep).mean() > 0.1 and (results[0][1] == 0).mean() > 0.1
