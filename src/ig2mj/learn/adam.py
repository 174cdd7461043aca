"""Adam over one flat vector, with gradients that are averaged over the devices.

All arrays of a gradient are concatenated first, so that one exchange between devices and one kernel replace one for
every layer.
"""

from __future__ import annotations

from typing import Any

import optax

from ig2mj.learn.running_stats import average


def averaged_adam(largest: float, axis: str | None = None, eps: float = 1e-8) -> optax.GradientTransformation:
    """Adam's steps, to be multiplied with the rate and subtracted.

    Args:
      largest: norm that an averaged gradient is cut down to. axis: of devices, whose own gradients `update` is given;
        None: there is one device. eps: Adam's.
    """
    clip = optax.clip_by_global_norm(largest)

    def shared(slope: Any, _: Any) -> Any:
        return clip.update(average(slope, axis), optax.EmptyState())[0]

    return optax.flatten(optax.chain(optax.stateless(shared), optax.scale_by_adam(eps=eps)))
