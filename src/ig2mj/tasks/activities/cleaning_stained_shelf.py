"""Cleaning Stained Shelf: a wet towel must wipe the stains off a shelf; half of them may stay.

The shelf is a board on the wall of birch's kitchen, open to all sides but the wall's. Our homes' own shelves are
bookcases, of whose stains few can be reached within an episode: those on the back, in the corners and behind cannot.
The towel is a folded hand towel whose underside wipes, and lies on it: towels are rigid, and turning one over
takes a third of an episode. Stains are spread evenly over all faces of the board but its underside.

The expert takes the towel from above, and presses it flat on one stain after the other.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.particles import world_normals, world_positions
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, levelled, over, where
from ig2mj.tasks.experts.pushing import draw
from ig2mj.tasks.experts.reaching import take
from ig2mj.tasks.experts.sight import ExpertView
from ig2mj.tasks.points import At, Hand, NearestStain
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Task

TOWEL, SHELF = "hand_towel_0", "shelf_2"

PRESS = 0.01
"""m below the board that the towel's underside goes for."""

LIFT = 0.02
"""m above the board on the way to the next stain: an arm that drags what it presses down is held back by friction."""

WITHIN, BLEND = 0.06, 0.03
"""m from the towel's middle within which a stain is under it, and over which the towel comes down to that."""

FACING_UP = 0.7
"""Smallest z of the normal of a stain that a flat towel wipes."""

AT_WALL, LATER = 0.035, 1.0
"""m from the wall within which stains are an arm's last, as though they were so much farther away: it comes askew to
the board's end, where the towel's corner meets the wall before the stain is under it, and half of all will do."""


def plan(see: ExpertView) -> list[HandMotion]:
    """One hand."""
    towel, (low, high) = see.com(TOWEL), see.box(TOWEL)
    if see.physical:
        return [draw(see, TOWEL, _nearest(see, towel))]
    (_, wall, _), (_, _, board) = (jnp.asarray(corner).T for corner in see.box(SHELF))
    underside = jnp.concatenate([towel[:, :2], low[:, 2:]], axis=1)
    dirt = _nearest(see, towel)
    nearest_to_wall = wall + 0.5 * (high - low)[:, 1]  # with its edge at the wall the towel covers stains there, too
    goal = jnp.stack([dirt[:, 0], jnp.maximum(dirt[:, 1], nearest_to_wall), board - PRESS], axis=1)
    move = over(underside, goal, board + LIFT, near=WITHIN, blend=BLEND)
    return [where(see.holds(TOWEL), hand_motion(move, levelled(see.quat(TOWEL)), close=True), take(see, TOWEL))]


def _nearest(see: ExpertView, towel: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
    """The stain on the board's top that is nearest to the towel; the towel itself where there is none."""
    row = STAIN.row_of(see.model, see.scene.object_index(SHELF))
    pos = world_positions(see.states.stain, see.view)[:, row]
    up = world_normals(see.states.stain, see.view)[:, row, :, 2] > FACING_UP
    left = jnp.asarray(see.states.stain.alive)[:, row] & up
    apart = length((pos - towel[:, None])[..., :2])
    if see.on_arm:
        low, _ = see.box(SHELF)
        apart += LATER * (pos[..., 1] < low[:, None, 1] + AT_WALL)
    apart = jnp.where(left, apart, jnp.inf)
    nearest = pos[np.arange(pos.shape[0]), jnp.argmin(apart, axis=1)]
    return jnp.where(left.any(1)[:, None], nearest, towel)


BOARD = "shelf/shelf_14@-1,-3.405,0.9,90"
"""Where the board is fixed: its middle 14.5 cm from the wall, its top 92.5 cm above the floor."""

CLEANING_STAINED_SHELF = Task(
    name="CleaningStainedShelf",
    summary="Wipe half of the stains off the shelf with the wet towel.",
    home="birch",
    objects=("hand_towel", BOARD),
    start=("(on_top hand_towel_0 shelf_2)", "(soaked hand_towel_0)", "(stained shelf_2)"),
    near=(),
    upright=("hand_towel_0",),
    goal="(not (stained shelf_2))",
    objects_of_interest=("hand_towel_0", "shelf_2"),
    distances=((Hand(0), At("hand_towel_0")), (At("hand_towel_0"), NearestStain("shelf_2", "hand_towel_0"))),
    robots={
        "humanoid": Acts((-1.15, -2.83, 0.55), yaw=-90.0, hands=RIGHT, weights=HUMANOID_WEIGHTS),
        "fetch": Acts((-1.15, -2.62, 0.0), yaw=-90.0),
    },
    stains_of="shelf_2",
    expert=plan,
)
