"""Convex pairs listed by kind, and looked at in two phases: the same contacts."""

from __future__ import annotations

import types

import mujoco
import numpy as np
import pytest
import warp as wp
from kernel_loading import load_kernels_of
from mujoco.mjx.third_party import mujoco_warp
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver
from tumbling_shapes import SCENE

from ig2mj.engine.warp.patches import awake_kernels, pins

if pins.obstacles():
    pytest.skip(f"our kernels do not fit: {pins.obstacles()}", allow_module_level=True)

from ig2mj.engine.warp.kernels import launches_of
from ig2mj.engine.warp.patches import branches, pair_lists
from ig2mj.engine.warp.patches.replacements import KERNELS, original

WORLDS = 16
BOX, CAPSULE, MESH = (int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}")) for name in ("BOX", "CAPSULE", "MESH"))


def test_every_pair_is_in_the_list_of_its_kind_next_to_those_of_the_same_geoms(kernel_device):
    rng = np.random.default_rng(0)
    kind_of_geom = np.array([BOX, BOX, CAPSULE, MESH, MESH])
    pairs = np.sort(rng.integers(0, 5, (500, 2)), axis=1)
    pairs = pairs[kind_of_geom[pairs[:, 0]] <= MESH].astype(np.int32)
    order = np.argsort(kind_of_geom[pairs], axis=1, kind="stable")
    pairs: np.ndarray = np.take_along_axis(pairs, order, axis=1)
    worlds = rng.integers(0, 40, len(pairs)).astype(np.int32)
    marks = np.stack([np.arange(len(pairs)), -np.arange(len(pairs))], axis=1).astype(np.int32)
    m = types.SimpleNamespace(geom_type=wp.array(kind_of_geom.astype(np.int32), dtype=int))
    d = types.SimpleNamespace(ncollision=wp.array([400], dtype=int), naconmax=len(pairs))
    ctx = types.SimpleNamespace(
        collision_pair=wp.array(pairs, dtype=wp.vec2i),
        collision_pairid=wp.array(marks, dtype=wp.vec2i),
        collision_worldid=wp.array(worlds, dtype=int),
    )
    kinds = [(BOX, MESH), (CAPSULE, MESH), (BOX, BOX)]
    for kind, found in zip(kinds, pair_lists.listed_by_kind(m, d, ctx, kinds), strict=True):
        expected = [i for i in range(400) if tuple(kind_of_geom[pairs[i]]) == kind]
        count = int(found.count.numpy()[0])
        places = found.pairid.numpy()[:count, 0].astype(int)
        assert count == len(expected) > 10 and sorted(places) == expected
        assert np.array_equal(found.pair.numpy()[:count], pairs[places])
        assert np.array_equal(found.world.numpy()[:count], worlds[places])
        changes = (np.diff(found.pair.numpy()[:count], axis=0) != 0).any(axis=1).sum()
        assert changes < len(np.unique(pairs[expected], axis=0)), "each pair of geoms begins once"


def _contacts(model: mujoco.MjModel, start: mujoco.MjData, qpos: np.ndarray) -> np.ndarray:
    """Rows of all contacts in worlds with these positions, sorted: world, geoms, depth, place, normal."""
    put = mujoco_warp.put_model(model)
    put.opt.warn_overflow = 0
    data = mujoco_warp.put_data(model, start, nworld=len(qpos), naconmax=2000, naccdmax=900, njmax=600, nvmax=model.nv)
    data.qpos.assign(qpos)

    def act() -> None:
        mujoco_warp.kinematics(put, data)
        mujoco_warp.collision(put, data)

    with awake_kernels():
        load_kernels_of(act)
        act()
    assert not data.overflow.numpy().any()
    count = int(data.nacon.numpy()[0])
    contact = data.contact
    columns = [contact.worldid, contact.geom, contact.dist, contact.pos, contact.frame]
    rows = np.concatenate([c.numpy()[:count].reshape(count, -1).astype(float) for c in columns], axis=1)[:, :10]
    return rows[np.lexsort(np.round(rows, 4).T[::-1])]


def _farthest(expected: np.ndarray, found: np.ndarray) -> float:
    """How far, at most, a row is from the nearest one of the same world and geoms, in depth (m) and place (m)."""
    farthest = 0.0
    for row in expected:
        same = found[(found[:, :3] == row[:3]).all(1)]
        farthest = max(farthest, float(np.abs(same[:, 3:7] - row[3:7]).max(1).min()))
    return farthest


def test_streams_begin_when_all_their_memory_is_there(monkeypatch):
    """A stream waits for the one before it once, when it begins. A count that was set to 0 after that could be read
    before, and so were places that nobody had taken: an illegal address on a GPU."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    put = mujoco_warp.put_model(model)
    data = mujoco_warp.make_data(model, nworld=2, naconmax=200, naccdmax=90, njmax=600, nvmax=model.nv)
    events, in_turn = [], branches._in_turn

    def noted(name, act):
        def noting(*args, **kwargs):
            events.append(name)
            return act(*args, **kwargs)

        return noting

    def streams(device):
        for option in in_turn(device):
            events.append("stream")
            yield option

    monkeypatch.setattr(branches, "ON_PROCESSORS", True)
    monkeypatch.setattr(branches, "_in_turn", streams)
    monkeypatch.setattr(wp, "empty", noted("memory", wp.empty))
    monkeypatch.setattr(wp, "zeros", noted("memory", wp.zeros))
    with awake_kernels():
        launches_of(lambda: mujoco_warp.collision(put, data))
    first, last = events.index("stream"), len(events) - events[::-1].index("stream")
    assert events.count("stream") > 5, "of several kinds"
    assert events[:first].count("memory") > 10
    assert "memory" not in events[first:last]


def test_a_kernel_of_upstreams_is_asked_for_its_threads_where_it_is_launched(monkeypatch):
    monkeypatch.setattr(branches._noting, "original", lambda *_: lambda kernel, device: (64, 132))
    monkeypatch.setattr(branches.phases, "kind", lambda kernel: (6, 6))
    for phases_run, threads in ((True, (1, 1)), (False, (64, 132))):
        monkeypatch.setattr(branches, "runs", lambda group, phases_run=phases_run: phases_run)
        assert branches._block_size(None, None) == threads


@pytest.mark.slow
def test_contacts_are_those_of_one_kernel_for_each_kind(kernel_device, monkeypatch):
    model = mujoco.MjModel.from_xml_string(SCENE)
    start = mujoco.MjData(model)
    qpos = []
    for _ in range(WORLDS):
        mujoco.mj_step(model, start, nstep=3)
        qpos.append(start.qpos.copy())
    with monkeypatch.context() as upstream:
        place = (collision_driver, "convex_narrowphase")
        upstream.setitem(KERNELS._own, place, original(*place))
        expected = _contacts(model, start, np.array(qpos, np.float32))
    monkeypatch.setattr(branches, "ON_PROCESSORS", True)
    found = _contacts(model, start, np.array(qpos, np.float32))
    kinds = {tuple(model.geom_type[row[1:3].astype(int)]) for row in expected}
    assert len(kinds) > 5, "boxes, meshes, capsules and cylinders touch each other"
    assert (expected[:, 3] > 0).sum() > 20 and (expected[:, 3] < -0.001).sum() > 20, "near and in each other"
    assert np.array_equal(expected[:, :3], found[:, :3])
    assert _farthest(expected, found) < 1e-3 if kernel_device.is_cuda else np.allclose(expected, found, atol=1e-5)
