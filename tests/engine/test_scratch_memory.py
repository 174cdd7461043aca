"""Places in a block of memory do not overlap, are given back, and what does not fit is allocated elsewhere."""

from __future__ import annotations

import random
import types

from ig2mj.engine.warp.patches import scratch
from ig2mj.engine.warp.patches.scratch import ALIGNMENT, Arena, Counter


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
        wanted = draw.randrange(0, 6 * ALIGNMENT)
        place = arena.allocate(wanted)
        if place >= start:
            assert place % ALIGNMENT == 0 and place + wanted <= start + size
            assert all(place + max(wanted, 1) <= p or p + max(s, 1) <= place for p, s in held.items() if p >= start)
            held[place] = wanted
        else:
            arena.deallocate(place, wanted)
    for place, wanted in held.items():
        arena.deallocate(place, wanted)
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
