"""What a hand really does to a batch of worlds: a row of a benchmark is called disturbed only where this shows it.

Axes: W worlds, O objects, G geoms, M loose objects.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.mjx.contacts import warp_contacts
from ig2mj.engine.view import Array
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.scene.scene import Scene

MOVED = 0.02
"""Metres from where an object lay at the start."""

OUTSIDE, UNDER_FLOOR = 50.0, -0.1
"""Metres from the origin along an axis, and in height, beyond which an object's centre of mass is lost. What falls from
a table dips into the floor by up to 0.07 m for a step or two, and is not."""

MOST_LOST = 1e-3
"""Share of worlds that may have lost an object in a row that counts."""

LEAST = 0.1
"""Share of control steps in which the hand must touch a loose object, on average, for worlds to count as disturbed."""


@struct.dataclass
class Activity:
    """Of one control step. `touched`: the hand presses on a loose object. `awake`: degrees of freedom awake, the mean
    over the worlds and the most in one."""

    touched: Bool[Array, "W"]
    awake_mean: Float[Array, ""]
    awake_most: Float[Array, ""]


class Watch:
    """Looks at the physics of a Warp engine's worlds; `step` is pure."""

    def __init__(self, engine: WarpEngine):
        self.engine, self.loose = engine, loose_objects(engine.tables)
        self._hand, self._thing = geoms_of(engine.scene)

    def step(self, physics) -> Activity:
        """What goes on in the last physics step."""
        use = self.engine.usage(physics)
        contacts = warp_contacts(physics.data)
        geom = jnp.maximum(contacts.geom, 0)
        hand, thing = jnp.asarray(self._hand)[geom], jnp.asarray(self._thing)[geom]
        pair = (hand[:, 0] & thing[:, 1]) | (hand[:, 1] & thing[:, 0])
        world = jnp.where(contacts.valid & pair & (contacts.dist <= 0.0), contacts.world, self.engine.num_worlds)
        touched = jnp.zeros(self.engine.num_worlds, bool).at[world].set(True, mode="drop")
        return Activity(touched, use.awake_dofs.astype(jnp.float32).mean(), use.awake_dofs.max().astype(jnp.float32))

    def moved(self, before: Float[Array, "W O 3"], after: Float[Array, "W O 3"]) -> float:
        """Loose objects that lie elsewhere now, per world on average."""
        way = np.linalg.norm(np.asarray(after) - np.asarray(before), axis=-1)[:, self.loose]
        return float((way > MOVED).sum(1).mean())

    def lost(self, com: Float[Array, "W O 3"]) -> int:
        """Worlds in which a loose object is outside the house or below its floor."""
        return lost_worlds(np.asarray(com)[:, self.loose])


def lost_worlds(place: Float[np.ndarray, "W M 3"]) -> int:
    """Worlds in which a loose object's centre of mass (m) is `OUTSIDE` or `UNDER_FLOOR`."""
    return int(((np.abs(place) > OUTSIDE).any(-1) | (place[..., 2] < UNDER_FLOOR)).any(1).sum())


def geoms_of(scene: Scene) -> tuple[Bool[np.ndarray, "G"], Bool[np.ndarray, "G"]]:
    """Which geoms are solid parts of agents, and which of loose objects."""
    model, tables = scene.model, scene.tables
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    agent = tables.body_agent[model.geom_bodyid] >= 0
    return solid & agent, solid & np.isin(tables.geom_object, loose_objects(tables))


def summary(activity: Activity, own_dofs: int) -> dict[str, float]:
    """Of the activity of many steps (arrays [S, ...]): what goes into a row. `own_dofs`: the hand's own."""
    touched = np.asarray(activity.touched)
    return {
        "hand_contact_share": round(float(touched.mean()), 3),
        "worlds_touched_share": round(float(touched.any(0).mean()), 3),
        "awake_dofs_beside_the_hand": round(float(np.asarray(activity.awake_mean).mean()) - own_dofs, 2),
        "awake_dofs_peak": int(np.asarray(activity.awake_most).max()),
    }


def join(parts: list[Activity]) -> Activity:
    """One activity of several in a row."""
    return jax.tree.map(lambda *a: np.concatenate([np.asarray(x) for x in a]), *parts)
