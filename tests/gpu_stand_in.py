"""A CUDA device where there is none: what runs only on a GPU meets Warp's own `Device`, whose names must exist."""

from __future__ import annotations

import contextlib
import types

import warp as wp

ARCHITECTURE = 90
"""Of an H200."""


class Memory:
    """An allocator that gives addresses away and no memory."""

    def __init__(self) -> None:
        self.taken: list[int] = []

    def allocate(self, size_in_bytes: int) -> int:
        self.taken.append(size_in_bytes)
        return sum(self.taken) << 8

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        pass


def gpu_of_jax() -> types.SimpleNamespace:
    """What is asked of a device of JAX's."""
    return types.SimpleNamespace(platform="gpu", local_hardware_id=0)


def gpu_of_warp(memory: Memory, newer_driver: bool = False) -> wp.Device:
    """A `warp.Device` that was never initialised: all of its methods, and the attributes that need no driver.

    Args:
      memory: what is allocated on it.
      newer_driver: it knows programs of Warp's toolkit, so that Warp compiles to PTX for an older architecture.
    """
    wp.init()
    device = wp.Device.__new__(wp.Device)
    real = wp.get_device("cpu").runtime
    runtime = types.SimpleNamespace(driver_version=(12, 0), toolkit_version=(12, 9), default_device=real.default_device)
    if newer_driver:
        runtime.driver_version = (13, 0)
    known = {"ordinal": 0, "alias": "cuda:0", "arch": ARCHITECTURE, "is_cubin_supported": True}
    known |= {"runtime": runtime, "context_guard": contextlib.nullcontext(), "default_allocator": memory}
    vars(device).update(known | {"current_allocator": memory, "_custom_allocator": None})
    return device
