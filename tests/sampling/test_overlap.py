"""What is disturbed at random is put into nothing, and rows of a pool stand apart."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.sampling.overlap import Overlaps
from ig2mj.sampling.perturbation import LIFT, loose_objects, perturb
from ig2mj.sampling.settled import RESTING_OVERLAP, make_pool
from ig2mj.scene import manifest as mf
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.worlds.random_streams import episode_keys

GAP = 0.01
"""Metres between the box in the slot and the lid over it: less than anything is lifted."""

SCENE = f"""<mujoco><option timestep="0.0083333" gravity="0 0 -9.8"><flag sleep="enable"/></option><worldbody>
<body name="floor"><geom name="floor/collision_0" type="box" size="2 2 0.05" pos="0 0 -0.05"/></body>
<body name="lid"><geom name="lid/collision_0" type="box" size="0.5 0.5 0.02" pos="0 0 {0.08 + GAP + 0.02}"/></body>
<body name="slotted" pos="0 0 0.04"><freejoint name="slotted/free"/>
<geom name="slotted/collision_0" type="box" size="0.04 0.04 0.04"/></body>
<body name="loose" pos="1 1 0.04"><freejoint name="loose/free"/>
<geom name="loose/collision_0" type="box" size="0.04 0.04 0.04"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def slot(tmp_path_factory) -> Scene:
    folder = tmp_path_factory.mktemp("slot")
    (folder / "scene.xml").write_text(SCENE)
    entries = [
        mf.ObjectEntry(name, category, "made", [name], fixed, (1, 1, 1), 1.0)
        for name, category, fixed in (
            ("floor", "floors", True),
            ("lid", "shelf", True),
            ("slotted", "apple", False),
            ("loose", "apple", False),
        )
    ]
    mf.save_manifest(mf.Manifest(mf.FORMAT_VERSION, "slot", entries), folder / "manifest.json")
    return ig2mj.load_scene(folder)


def _at(scene: Scene, height: float) -> np.ndarray:
    qpos = np.array(scene.model.qpos0)
    qpos[int(scene.model.joint("slotted/free").qposadr[0]) + 2] += height
    return qpos


def test_depth_is_that_of_the_deepest_contact_with_something_else(slot: Scene):
    overlaps = Overlaps(slot)
    index = slot.object_index
    assert overlaps.deepest(_at(slot, 0.001)).max() < 1e-9
    deep = overlaps.deepest(_at(slot, GAP + 0.005))
    assert deep[index("slotted")] == pytest.approx(0.005, abs=1e-4)
    assert deep[index("lid")] == deep[index("slotted")]
    assert deep[index("loose")] < 1e-6 and deep[index("floor")] < 1e-6
    assert overlaps.deepest(_at(slot, 0.001)).max() < 1e-9, "the state before leaves nothing behind"


def test_what_would_be_put_into_something_stays_where_it_was(slot: Scene):
    engine, keys = NativeEngine(slot, 4), episode_keys(0, jnp.arange(4), jnp.zeros(4, jnp.int32))
    write = perturb(slot.tables, loose_objects(slot.tables), engine.view(engine.reset()), keys, 1.0)
    lifted = engine.write(engine.reset(), jax.device_get(write))
    overlaps, index = Overlaps(slot), slot.object_index("slotted")
    depths = [overlaps.deepest(row)[index] for row in np.asarray(engine.snapshot(lifted).qpos)]
    assert min(depths) > 0.5 * (LIFT[0] - GAP), "by itself the disturbance puts the box into the lid"

    pool = make_pool(slot, StateModel.of_manifest(slot.tables, slot.manifest), 4, share=1.0, threads=1)
    rows = np.asarray(pool.physics.qpos)
    for row in rows:
        assert overlaps.deepest(row).max() < RESTING_OVERLAP
    place = int(slot.model.joint("slotted/free").qposadr[0])
    assert np.abs(rows[:, place : place + 3] - slot.model.qpos0[place : place + 3]).max() < 1e-3
    other = int(slot.model.joint("loose/free").qposadr[0])
    assert np.ptp(rows[:, other]) > 0.005, "the other box is disturbed as ever"
