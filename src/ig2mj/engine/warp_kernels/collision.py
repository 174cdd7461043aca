"""Collision detection: a broad phase for what is awake, and contacts that are looked through afterwards."""

from __future__ import annotations

from typing import Any

from mujoco.mjx.third_party.mujoco_warp._src import collision_driver

from ig2mj.engine.warp_kernels.broadphase import awake_broadphase, serves
from ig2mj.engine.warp_kernels.contacts import mend_contacts
from ig2mj.engine.warp_kernels.originals import original


def choose_broadphase(name: str, m: Any, d: Any, ctx: Any, awake_prev: Any = None) -> None:
    """The broad phase of what is awake where it finds all pairs; else `name`, the one that MuJoCo Warp chose."""
    if serves(m):
        awake_broadphase(m, d, ctx, awake_prev)
    else:
        original(collision_driver, name)(m, d, ctx, awake_prev)


def collision(m: Any, d: Any, awake_prev: Any = None) -> None:
    """Collision detection as upstream; then contacts are checked against their geoms."""
    original(collision_driver, "collision")(m, d, awake_prev)
    if d.naconmax > 0:
        mend_contacts(m, d)
