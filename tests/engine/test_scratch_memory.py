"""Places in a block of memory do not overlap, are given back, and what does not fit is allocated elsewhere; steps find
in them what they wrote themselves."""

from __future__ import annotations

import ctypes
import random
import types

import msgspec
import mujoco
import numpy as np
import pytest
import warp as wp
from mujoco.mjx.third_party import mujoco_warp
from tumbling_shapes import SCENE

from ig2mj import load_scene
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import awake_kernels, pins, scratch
from ig2mj.engine.warp.patches.scratch import ALIGNMENT, Arena, Counter
from ig2mj.engine.warp.profile import default_profile
from ig2mj.errors import EngineError


class Elsewhere:
    """Counts what is asked of it; its addresses are below the block."""

    def __init__(self) -> None:
        self.held: dict[int, int] = {}

    def allocate(self, size_in_bytes: int) -> int:
        self.held[1 + len(self.held)] = size_in_bytes
        return len(self.held)

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        assert self.held.pop(ptr) == size_in_bytes


def test_places_do_not_overlap_and_all_of_the_block_can_be_used_again():
    start, size, elsewhere, draw = 1 << 20, 64 * ALIGNMENT, Elsewhere(), random.Random(0)
    arena = Arena(start, size, elsewhere)
    held: dict[int, int] = {}
    for _ in range(2000):
        if held and draw.random() < 0.5:
            place = draw.choice(list(held))
            arena.deallocate(place, held.pop(place))
            continue
        requested = draw.randrange(0, 6 * ALIGNMENT)
        place = arena.allocate(requested)
        if place >= start:
            assert place % ALIGNMENT == 0 and place + requested <= start + size
            assert all(place + max(requested, 1) <= p or p + max(s, 1) <= place for p, s in held.items() if p >= start)
            held[place] = requested
        else:
            arena.deallocate(place, requested)
    for place, requested in held.items():
        arena.deallocate(place, requested)
    assert not elsewhere.held
    assert arena.allocate(size) == start


def test_the_most_that_is_held_at_a_time_is_counted():
    counter = Counter(Elsewhere())
    first = counter.allocate(100)
    counter.deallocate(first, 100)
    counter.allocate(70)
    counter.allocate(50)
    assert counter.most == 120 and counter.arrays == 3


def test_a_block_may_be_larger_than_arrays_of_warp_and_is_taken_once(monkeypatch):
    monkeypatch.setattr(scratch, "_arenas", {})
    taken = []
    allocator = types.SimpleNamespace(allocate=lambda size: taken.append(size) or 1 << 20)
    device = types.SimpleNamespace(alias="cuda:0", default_allocator=allocator, get_allocator=lambda: allocator)
    for size in (5 << 30, 3 << 30, 5 << 30, 9 << 30):
        scratch.reserve(device, size)
    assert taken == [5 << 30, 9 << 30]


class Poisoned(Arena):
    """What is taken, and what is given back, holds no numbers. The memory is its own."""

    def __init__(self, size: int):
        self._block = ctypes.create_string_buffer(size + ALIGNMENT)
        super().__init__(-(-ctypes.addressof(self._block) // ALIGNMENT) * ALIGNMENT, size, None)

    def allocate(self, size_in_bytes: int) -> int:
        place = super().allocate(size_in_bytes)
        ctypes.memset(place, 0xFF, self._taken[place])
        return place

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        ctypes.memset(ptr, 0xFF, self._taken[ptr])
        super().deallocate(ptr, size_in_bytes)


@pytest.mark.slow
@pytest.mark.skipif(bool(pins.obstacles()), reason="our kernels do not fit")
def test_steps_need_nothing_of_what_was_in_their_memory_before(monkeypatch):
    from ig2mj.engine.warp.patches import branches

    monkeypatch.setattr(branches, "ON_PROCESSORS", True)
    model, device = mujoco.MjModel.from_xml_string(SCENE), wp.get_device("cpu")

    def after(steps: int, arena: Arena | None) -> np.ndarray:
        put = mujoco_warp.put_model(model)
        put.opt.warn_overflow = 0
        data = mujoco_warp.put_data(
            model, mujoco.MjData(model), nworld=2, naconmax=1000, naccdmax=500, njmax=600, nvmax=model.nv
        )
        with monkeypatch.context() as patch, awake_kernels(), wp.ScopedDevice(device):
            if arena:
                patch.setattr(device, "get_allocator", lambda pinned=False: arena)
            for _ in range(steps):
                mujoco_warp.step(put, data)
        return data.qpos.numpy()

    expected = after(60, None)
    assert abs(expected - model.qpos0).max() > 0.1 and np.isfinite(expected).all()
    assert np.array_equal(after(60, Poisoned(64 << 20)), expected)


def test_too_little_memory_for_a_home_without_measured_sizes_names_the_remedy(monkeypatch):
    scene = load_scene("small_home")
    engine = WarpEngine(scene, 1)
    monkeypatch.setattr(engine, "profile", default_profile(scene.model))
    monkeypatch.setattr(engine, "_scratch", 7 * 10**11)
    monkeypatch.setattr(wp, "device_from_jax", lambda device: device)

    def reserve(device, size):
        raise RuntimeError(f"Failed to allocate {size} bytes on device 'cuda:0'")

    monkeypatch.setattr(scratch, "reserve", reserve)
    with pytest.raises(EngineError, match=r"700 GB for 1 worlds: .*ig2mj calibrate small_home"):
        engine.prepare_devices(["cuda:0"])
    monkeypatch.setattr(engine, "profile", msgspec.structs.replace(engine.profile, awake_dofs=1))
    with pytest.raises(EngineError, match="use fewer worlds, smaller images"):  # its sizes are measured
        engine.prepare_devices(["cuda:0"])
