"""Slicing Fruit: an apple must be cut with a knife that lies on the same table.

The expert takes the knife by its handle, turns its edge down, and presses it onto the apple.

With "physical" grasping the knife has a stout handle, 3.6 cm wide and 5 cm high, on which it stands with its edge down,
so that it need not be turned. Of the other's handle, which is 2.1 cm high as it lies, fingers over a table hold a
centimetre, and it slips from them.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length, quat_rotate
from ig2mj.scene.tables import LinkKind
from ig2mj.tasks.experts.gripping import grip_from_above
from ig2mj.tasks.experts.motion import HandMotion, hand_motion, horizontal, over, where
from ig2mj.tasks.experts.reaching import far_out, take_thin
from ig2mj.tasks.experts.sight import ExpertView
from ig2mj.tasks.points import At, Hand
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, TABLES, Acts, Fit, Near, Physical, Task

KNIFE, FRUIT = "carving_knife_0", "apple_0"

HANDLE, ALONG, EDGE = (-0.105, 0.007, 0.011), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
"""Where the hand takes the handle, m: so far back that fingers stay clear of the fruit. Where the blade points, and the
direction in which it cuts. The knife's frame."""

TIPWARD = -0.01
"""m from the middle of the edge to the point that cuts."""

STEEP = 1.25
"""rad between the edge's direction and straight down that are steep enough. Steeper, fingers would meet the table."""

CLEARANCE = 0.07
"""m above the fruit at which the blade comes over it."""

EXACT = {False: 0.02, True: 0.015}
"""By whether an arm carries the hand: m next to the fruit's middle at which the blade comes down. Farther out the fruit
rolls away. With 8 mm, a policy that sees both 1 cm off, differently in each step, hovers above it."""

PRESS = {False: 0.08, True: 0.03}
"""By whether an arm carries the hand: m below the fruit's top that the blade goes for. A floating hand's is more than a
step, so that on the fruit it presses with all force; the gripper of an arm would push the fruit away."""

SLOWLY, WITHIN = 0.012, 0.11
"""m that an arm comes down onto the handle in a step, and from it within which it is so slow. What it holds is computed
from where its hand was at the end of the step that took it (`ig2mj.learn.occlusion`): at full speed 0.5 cm off in the
median and 1.7 cm in a tenth of the episodes."""

GENTLY = 1 / 3
"""Share of the turn that is left that is made at once. With all of it the compliant hand oscillates at full
speed, and a policy that learns from that hardly turns."""

CUTS, ABOUT, BESIDE, LATER = -0.05, (-0.03, 0.05), 0.012, 0.008
"""Of a knife that stands: m from the middle of the edge to the point that cuts, near the handle, so that what presses
on it hardly tips the knife between two fingers; how far from there any other point will do; m next to the edge within
which it comes down, and farther out over which it begins to."""


def plan(see: ExpertView) -> list[HandMotion]:
    """One hand."""
    done = jnp.asarray(see.states.sliced)[:, see.scene.object_index(FRUIT)]
    still = hand_motion(jnp.zeros_like(see.pos(KNIFE)), close=True)
    if see.physical and see.two_fingers:  # (the humanoid's fingers close too far next to the handle)
        return [where(done, still, _grip_and_press(see))]
    quat = see.quat(KNIFE)
    handle = see.pos(KNIFE) + quat_rotate(quat, jnp.asarray(HANDLE, jnp.float32))
    along = quat_rotate(quat, jnp.asarray(ALONG, jnp.float32))
    blade = see.link(KNIFE, LinkKind.SLICER) + TIPWARD * along
    _, high = see.box(FRUIT)
    fruit, top = see.com(FRUIT), high[:, 2]
    turn, left = _edge_down(quat_rotate(quat, jnp.asarray(EDGE, jnp.float32)))
    turn = GENTLY * (turn + horizontal(along))
    depth = jnp.where(left < 0.2, top - PRESS[see.on_arm], top + CLEARANCE)
    goal = jnp.concatenate([fruit[:, :2], depth[:, None]], axis=1)
    take = take_thin(see, handle)
    if see.on_arm:
        turn += far_out(see, goal)
        slow = jnp.where(length(see.grip() - handle) < WITHIN, -SLOWLY, -jnp.inf)
        take = HandMotion(jnp.asarray(take.move).at[:, 2].max(slow), far_out(see, handle), take.close)
    exact = EXACT[see.on_arm]
    cut = hand_motion(over(blade, goal, top + CLEARANCE, near=exact, blend=exact), turn, close=True)
    return [where(done, still, where(see.holds(KNIFE), cut, take))]


def _grip_and_press(see: ExpertView) -> HandMotion:
    """With a knife that stands on its handle, edge down."""
    along = quat_rotate(see.quat(KNIFE), jnp.asarray(ALONG, jnp.float32))
    up = quat_rotate(see.quat(KNIFE), jnp.array([0.0, 0.0, 1.0]))
    _, high = see.box(FRUIT)
    goal = jnp.asarray(see.com(FRUIT)).at[:, 2].set(high[:, 2] - PRESS[see.on_arm])
    blade = see.link(KNIFE, LinkKind.SLICER) + CUTS * along
    blade += jnp.clip(jnp.sum((goal - blade) * along, axis=1, keepdims=True), *ABOUT) * along
    move = over(blade, goal, high[:, 2] + CLEARANCE, near=BESIDE, blend=LATER)
    press = hand_motion(move, horizontal(along) + jnp.cross(up, np.array([0.0, 0.0, 1.0], np.float32)), close=True)
    return grip_from_above(see, KNIFE, along, press)


def _edge_down(edge: Float[Array, "W 3"]) -> tuple[Float[Array, "W 3"], Float[Array, "W"]]:
    """The turn that is left until the edge is steep, and its angle."""
    axis = jnp.cross(edge, np.array([0.0, 0.0, -1.0], np.float32))
    angle = jnp.arccos(jnp.clip(-edge[:, 2], -1.0, 1.0))
    left = jnp.maximum(angle - STEEP, 0.0)
    return axis / jnp.maximum(length(axis), 1e-6)[:, None] * left[:, None], left


ON_NEAR_SIDE = (
    Near("apple_0", (2.15, -0.1, 0.85), most=0.95),
    Near("carving_knife_0", (2.15, -0.1, 0.85), most=0.95),
)

SLICING_FRUIT = Task(
    name="SlicingFruit",
    summary="Cut the apple on the coffee table with the knife.",
    home="birch",
    objects=("apple", "carving_knife"),
    start=("(on_top apple_0 coffee_table_0)", "(on_top carving_knife_0 coffee_table_0)"),
    near=ON_NEAR_SIDE,
    flat=("carving_knife_0",),
    goal="(sliced apple_0)",
    objects_of_interest=("carving_knife_0", "apple_0"),
    distances=((Hand(0), At("carving_knife_0")), (At("carving_knife_0"), At("apple_0"))),
    robots={
        # 5 cm nearer, the camera loses one apple in seven, which lies below its image or next to it.
        "humanoid": Acts((2.24, -0.03, 0.55), hands=RIGHT, weights=HUMANOID_WEIGHTS),
        # At the usual 0.45 rad most of the low table before it is below its image.
        "fetch": Acts((2.28, -0.12, 0.015), yaw=-15.0, camera_tilt=1.0),
    },
    physical=Physical(
        tuple((f"apple/apple_{apple:02d}", f"carving_knife/carving_knife_{4 + apple:02d}") for apple in range(3)),
        near=ON_NEAR_SIDE,
    ),
    expert=plan,
    fit=Fit(surface="coffee_table_0", surfaces=TABLES),
)
