"""Kernels that the ray caster launches for a call of `BatchCamera`, so that they are compiled before the first one."""

from __future__ import annotations

import copy
from typing import Any

from mujoco.mjx.third_party import mujoco_warp

from ig2mj.engine.warp.kernels import Launch, launches_of
from ig2mj.engine.warp.patches import upstream_kernels


class _Data:
    """MuJoCo Warp's data of one world, of which launches that are only noted read nothing but the number of worlds."""

    nworld = 1

    def __getattr__(self, name: str) -> None:
        return None


class _Untouched:
    """Stands for an image or a tree that is not to change."""

    def fill_(self, value: Any) -> None: ...

    def refit(self) -> None: ...


def launches_of_images(model: Any, context: Any) -> list[Launch]:
    """The kernels that bring the tree of boxes up to date and cast rays.

    Args:
      model: MuJoCo Warp's, of the render model. context: MuJoCo Warp's, complete.
    """
    data, context = _Data(), copy.copy(context)
    context.seg_data = context.bvh = _Untouched()

    def act() -> None:
        mujoco_warp.refit_bvh(model, data, context)  # pyright: ignore[reportArgumentType]
        mujoco_warp.render(model, data, context)  # pyright: ignore[reportArgumentType]

    with upstream_kernels():
        return launches_of(act)
