"""An expert's part in reinforcement learning: it begins episodes and labels states, with a share annealed to zero.

In every episode it acts for a number of steps that is sampled from 0 to a limit, then the policy takes over. The limit
falls to 0 over the first part of a run, so that the policy's starts move back from near the goal to the start of the
task: a reverse curriculum (Uchendu et al. 2023, "Jump-Start Reinforcement Learning"). A tenth of the episodes has no
expert from the start of the run; success is reported of those alone, also for a while after the help has ended: of the
unaided episodes that all worlds then begin at once the short ones end first, and those succeed.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.learn.collect import Advice

UNAIDED = 0.1
"""Share of the episodes in which the expert has no part."""


def remaining(progress: Float[Array, ""], decay: float) -> Float[Array, ""]:
    """A share that falls from 1 at the start of a run to 0 once the share `decay` of it is over."""
    return jnp.clip(1.0 - progress / max(decay, 1e-6), 0.0, 1.0)


def guided(
    key: Array,
    action: Float[Array, "W n"],
    advice: Advice,
    handover: Int[Array, "W"],
    limit: Float[Array, ""],
    noise: float,
) -> tuple[Float[Array, "W n"], Float[Array, "W n"], Int[Array, "W"]]:
    """The expert's actions where it still has the episode, the policy's elsewhere.

    Args:
      action: the policy's. handover: step of the running episode at which the policy takes over; -1 in the episodes
        that are the policy's from the start, whatever the limit.
      limit: of the steps that the expert acts in a new episode. noise: deviation of what is added to its actions.

    Returns:
      Actions; the expert's, as labels; the steps of handing over.
    """
    assert advice.label is not None, "guidance needs an expert"
    limit_key, which_key, noise_key = jax.random.split(key, 3)
    drawn = jax.random.randint(limit_key, handover.shape, 0, jnp.round(limit).astype(jnp.int32) + 1)
    drawn = jnp.where(jax.random.uniform(which_key, handover.shape) < UNAIDED, -1, drawn)
    handover = jnp.where(advice.steps == 0, drawn, handover)
    label = jnp.clip(advice.label, -1.0, 1.0)
    noisy = jnp.clip(label + noise * jax.random.normal(noise_key, label.shape), -1.0, 1.0)
    return jnp.where((advice.steps < handover)[:, None], noisy, action), label, handover


def uncounted(
    aided: Bool[Array, "W"], since: Int[Array, "W"], helps: Bool[Array, ""], horizon: int
) -> tuple[Bool[Array, "W"], Int[Array, "W"]]:
    """Whether a running episode is left out of the success that is reported, and `since` after another step.

    All count once a horizon has passed without help.

    Args:
      aided: not one of those that are the policy's from the start. since: steps of each world since the help ended.
      helps: it has not ended. horizon: agent steps of an episode.
    """
    since = jnp.where(helps, 0, since + 1)
    return aided & (since <= horizon), since
