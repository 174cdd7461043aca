"""A floating hand that goes about pushing loose objects: the disturbance of benchmarks and of `ig2mj calibrate`.

Each world's hand goes from object to object on ways known to be free (`ig2mj.calibration.reach`) and pushes each
from its present place along the way it came. Pure JAX, a few table look-ups per world.

    reach = find_reach(ig2mj.load_scene(home))
    scene = ig2mj.load_scene(home, [FloatingHand(pos=reach.start)])
    pusher = start_pushing(reach, num_worlds, scene.model.nu)
    pusher = push(reach, pusher, view.object_com, view.agent.base_pos[:, 0], key, step, seconds)     # then pusher.ctrl

Axes: W worlds, N reachable objects.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.calibration.reach import Reach
from ig2mj.engine.view import Array
from ig2mj.worlds.random_streams import step_keys

TRAVEL_SPEED, PUSH_SPEED = 1.0, 0.5
"""m/s at which the hand's target moves between objects, and close to the object it pushes."""

CLOSE = 0.25
"""Metres from the place to be reached from which the hand moves at `PUSH_SPEED`."""

PUSH_SECONDS = 0.8
"""Seconds for which the hand pushes on after it should have met an object."""

PAST, OVER = 0.15, 0.06
"""Metres: a hand that is this close over an object's place, without having pushed it away, moves on this far."""

FOLLOW, GONE_DOWN = 0.4, 0.1
"""Metres: objects further from their settled place, or this much lower, are left alone; the way there is not known."""

LEASH = 0.1
"""Metres along each axis that the target may be ahead of the palm: a hand that is stuck does not push ever harder."""

ARRIVED = 0.02
"""Metres from a station at which the hand turns to the next stretch."""

IMPATIENCE = 4
"""Times as fast a hand that is held back gives up."""


@struct.dataclass
class Pusher:
    """What the hands are about.

    Attributes:
      ctrl: controls; the first three are the hand's x, y and z from the start (see `add_floating_hand`), m.
      goal: row of `Reach.objects`: what is to be pushed.
      node: of `Reach.nodes`: where the hand goes now. came: the one before.
      pushes: it has come to the goal.
      left: control steps until it gives up going there, or pushing.
      heading: horizontal unit vector along which the goal is pushed.
    """

    ctrl: Float[Array, "W nu"]
    goal: Int[Array, "W"]
    node: Int[Array, "W"]
    came: Int[Array, "W"]
    pushes: Bool[Array, "W"]
    left: Int[Array, "W"]
    heading: Float[Array, "W 2"]


def start_pushing(reach: Reach, num_worlds: int, num_controls: int) -> Pusher:
    """Hands at the start, about to go to the object next to it. No two arrays are the same: they may be donated."""
    return Pusher(
        ctrl=jnp.zeros((num_worlds, num_controls), jnp.float32),
        goal=jnp.full(num_worlds, reach.first, jnp.int32),
        node=jnp.full(num_worlds, reach.start_node, jnp.int32),
        came=jnp.full(num_worlds, reach.start_node, jnp.int32),
        pushes=jnp.zeros(num_worlds, bool),
        left=jnp.ones(num_worlds, jnp.int32),
        heading=jnp.zeros((num_worlds, 2), jnp.float32),
    )


def push(
    reach: Reach,
    pusher: Pusher,
    object_com: Float[Array, "W O 3"],
    palm: Float[Array, "W 3"],
    key: UInt[Array, "W 2"],
    step: Int[Array, "W"],
    seconds: float,
) -> Pusher:
    """The pusher with the controls of the next control step.

    Args:
      reach: the hand must have been added at its start.
      object_com, palm: where everything and the hand's base body is (`PhysicsView`), m.
      key, step: random keys of the worlds' episodes, and their control steps.
      seconds: length of a control step.
    """
    ctrl, palm = jnp.asarray(pusher.ctrl), jnp.asarray(palm)
    start, nodes, over = (jnp.asarray(a, jnp.float32) for a in (reach.start, reach.nodes, reach.over))
    hop, count = jnp.asarray(reach.hop, jnp.int32), len(reach.objects)
    here = ctrl[:, :3] + start

    def place_of(goal: Int[Array, "W"]) -> tuple[Float[Array, "W 3"], Bool[Array, "W"]]:
        """The palm's place at an object now, and whether that is still near where ways lead."""
        com = jnp.take_along_axis(jnp.asarray(object_com), jnp.asarray(reach.objects)[goal][:, None, None], axis=1)
        place = com[:, 0].at[:, 2].add(over[goal])
        moved = place - nodes[goal]
        return place, (jnp.linalg.norm(moved, axis=-1) < FOLLOW) & (moved[:, 2] > -GONE_DOWN)

    place, near = place_of(pusher.goal)
    pushes = jnp.asarray(pusher.pushes)
    over_ = pushes & ((pusher.left <= 0) | ~near)  # pushed enough, or away
    arrives = ~pushes & (jnp.linalg.norm(nodes[pusher.node] - here, axis=-1) < ARRIVED)
    fails = ~pushes & ~arrives & (pusher.left <= 0)

    # Another object; the old one, if what is drawn went too far away.
    draw, angle = jnp.moveaxis(jax.vmap(lambda k: jax.random.uniform(k, (2,)))(step_keys(key, step)), 1, 0)
    drawn = (draw[:, None] > jnp.asarray(reach.choice, jnp.float32)[pusher.goal]).sum(1)
    drawn = jnp.minimum(drawn, count - 1).astype(jnp.int32)
    wants = over_ | fails | (~pushes & ~near)
    goal = jnp.where(wants & place_of(drawn)[1], drawn, pusher.goal)

    # The next node: back to where the pushed object lay, back to the last node, or onward.
    onward = hop[pusher.node, goal]
    meets = arrives & (onward == goal) & (goal == pusher.goal) & near
    node = jnp.where(arrives & (onward >= 0), onward, pusher.node)
    node = jnp.where(over_, pusher.goal, jnp.where(fails, pusher.came, node)).astype(jnp.int32)
    came = jnp.where(over_, pusher.came, jnp.where(arrives | fails, pusher.node, pusher.came)).astype(jnp.int32)
    pushes = (pushes & ~over_) | meets
    begins = over_ | fails | arrives

    place, _ = place_of(goal)
    way = place - here
    flat = jnp.linalg.norm(way[:, :2], axis=-1, keepdims=True)
    turn = 2 * jnp.pi * angle
    anywhere = jnp.stack([jnp.cos(turn), jnp.sin(turn)], axis=-1)
    toward = jnp.where(flat > 0.05, way[:, :2] / jnp.maximum(flat, 1e-6), anywhere)
    heading = jnp.where(meets[:, None], toward, pusher.heading)

    past = jnp.where(flat < OVER, PAST, 0.0) * heading
    target = jnp.where(pushes[:, None], jnp.asarray(place).at[:, :2].add(past), nodes[node])
    way = target - here
    distance = jnp.linalg.norm(way, axis=-1)
    stride = jnp.where(pushes & (distance < CLOSE + PAST), PUSH_SPEED, TRAVEL_SPEED) * seconds
    allowed = 1.3 * distance / (TRAVEL_SPEED * seconds) + jnp.where(pushes, PUSH_SECONDS, 0.2) / seconds
    allowed = jnp.ceil(jnp.where(jnp.isfinite(allowed), allowed, 0.0)).astype(jnp.int32)
    ahead = here + way * jnp.minimum(1.0, stride / jnp.maximum(distance, 1e-6))[:, None]
    held = (jnp.abs(ahead - palm) > LEASH).any(1)
    left = jnp.where(begins, allowed, pusher.left - jnp.where(held, IMPATIENCE, 1))
    ahead = jnp.clip(ahead, palm - LEASH, palm + LEASH) - start
    sound = jnp.isfinite(ahead).all(1)[:, None]
    return Pusher(
        ctrl=ctrl.at[:, :3].set(jnp.where(sound, ahead, ctrl[:, :3])),
        goal=goal.astype(jnp.int32),
        node=node,
        came=came,
        pushes=pushes,
        left=jnp.maximum(left, 0).astype(jnp.int32),
        heading=jnp.where(jnp.isfinite(heading), heading, 0.0),
    )
