"""Soaking Towel: a towel on the dishwasher must be held under a tap that runs.

The expert takes the towel, brings it in front of the tap, and slides it below the spout.

Towels are rigid, and folded flat they are wider than Fetch's gripper opens. With "physical" grasping the towel is
rolled up and stands on end, 7 cm across and 19 cm high, to the left of Fetch, which looks there: straight ahead it sees
the sink, which is always at one place, and no towel. The expert grips it below its upper end, and lets it down into the
basin before it slides it below the spout.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import length
from ig2mj.scene.tables import LinkKind
from ig2mj.tasks.experts.gripping import grip_standing
from ig2mj.tasks.experts.motion import RISE, HandMotion, around, hand_motion, levelled, outward, where
from ig2mj.tasks.experts.reaching import take, take_at
from ig2mj.tasks.experts.sight import ExpertView
from ig2mj.tasks.points import WATER_BELOW, At, Hand, Water
from ig2mj.tasks.task import HUMANOID_WEIGHTS, RIGHT, Acts, Fit, Near, Physical, Task

TOWEL, SINK = "bath_towel_0", "sink_0"


@dataclasses.dataclass(frozen=True)
class Way:
    """How a towel is brought below the spout; all in m.

    Attributes:
      top: of the towel's top below the tap's opening. (Where drops appear is 0.1 m below it.)
      ahead: of the towel's middle in front of the opening, so that the hand is not below the spout.
      run_up: in front of that where the towel comes down to the height at which it is slid in.
      carry: above that height on the way there.
      clear: in front of the run-up while it is more than `narrow` next to it: the fridge stands there.
      outside: from the middle of the robot's body that the towel passes it.
      straight: it goes straight to the run-up, and gives way to the robot's own body only where it meets it; else it
        swings around the robot.
    """

    top: float
    ahead: float
    run_up: float
    carry: float
    clear: float = 0.0
    narrow: float = 0.25
    outside: float = 0.42
    straight: bool = False


FOLDED = Way(top=0.025, ahead=0.11, run_up=0.25, carry=0.18)
LIFTED = Way(top=0.025, ahead=0.11, run_up=0.25, carry=0.26, clear=0.36, narrow=0.12, outside=0.0, straight=True)
ROLLED = Way(top=0.03, ahead=0.02, run_up=0.1, carry=0.42, clear=0.45, straight=True)

EXACT, BLEND = 0.03, 0.06
"""m off the way in up to which the towel counts as on it, and over which it becomes wholly off it."""

NEARLY = 0.1
"""m of a displacement that count where the way is straight."""

EDGE = 0.1
"""m from the towel's middle towards the robot at which the gripper of an arm takes it."""


def plan(see: ExpertView) -> list[HandMotion]:
    """One hand. The tap's front is where the robot stands: +y in its home."""
    if see.physical and see.two_fingers:  # (the humanoid's fingers push a roll out of the hand)
        return [grip_standing(see, TOWEL, _below_spout(see, ROLLED))]
    # A mitten drags the towel past the fridge's corner; another grasp breaks there. Above the humanoid's body is room.
    way = LIFTED if not see.on_arm and see.grasping != "mitten" else FOLDED
    move, turn, get = _below_spout(see, way), levelled(see.quat(TOWEL)), take(see, TOWEL)
    if see.on_arm:
        turn += outward(see.hand_quat(), see.grip() - see.base_pos())
        get = take_at(see, _near_edge(see))
    return [where(see.holds(TOWEL), hand_motion(move, turn, close=True), get)]


def _below_spout(see: ExpertView, way: Way) -> Float[Array, "W 3"]:
    """The displacement that brings a towel in hand below the spout."""
    opening = see.goal(Water(SINK), WATER_BELOW)
    towel, (_, high) = see.com(TOWEL), see.box(TOWEL)
    height = opening[:, 2] - way.top - (high[:, 2] - towel[:, 2])
    beside, ahead = towel[:, 0] - opening[:, 0], towel[:, 1] - opening[:, 1] - way.ahead
    off = jnp.maximum(_share(jnp.abs(beside)), _share(ahead - way.run_up))
    rise = height + way.carry * off - towel[:, 2]
    far = jnp.clip((jnp.abs(beside) - way.narrow) / BLEND, 0.0, 1.0)
    back = way.clear * far + way.run_up * jnp.maximum(off, _share(jnp.abs(towel[:, 2] - height)))
    go = jnp.clip(1.5 - rise / RISE, 0.0, 1.0)
    move = jnp.stack([-beside * go, (back - ahead) * go, rise], axis=1)
    if way.straight:
        share = jnp.minimum(1.0, NEARLY / jnp.maximum(length(move[:, :2]), 1e-6))
        move = move.at[:, :2].multiply(share[:, None])
    return around(towel, move, see.base_pos(), way.outside)


def _near_edge(see: ExpertView) -> Float[Array, "W 3"]:
    """A point of the towel's upper side, nearer to the robot than its middle: what sticks out lengthens the arm."""
    low, high = see.box(TOWEL)
    middle = jnp.asarray(0.5 * (low + high)).at[:, 2].set(high[:, 2])
    away = (middle - see.base_pos()) * jnp.array([1.0, 1.0, 0.0])
    return middle - EDGE * away / length(away)[:, None]


def _share(off: Float[Array, "W"]) -> Float[Array, "W"]:
    """0 on the way in, 1 wholly off it."""
    return jnp.clip((off - EXACT) / BLEND, 0.0, 1.0)


SOAKING_TOWEL = Task(
    name="SoakingTowel",
    summary="Hold the towel under the running tap until it is soaked.",
    home="cedar",
    objects=("bath_towel",),
    start=("(on_top bath_towel_0 dishwasher_0)", "(toggled_on sink_0)"),
    near=(Near("bath_towel_0", (2.74, -2.95, 0.85), most=1.05),),
    flat=("bath_towel_0",),
    goal="(soaked bath_towel_0)",
    objects_of_interest=("bath_towel_0", "sink_0"),
    distances=((Hand(0), At("bath_towel_0")), (At("bath_towel_0"), Water("sink_0"))),
    robots={
        "humanoid": Acts((2.95, -2.95, 0.55), yaw=-45.0, hands=RIGHT, weights=HUMANOID_WEIGHTS),
        "fetch": Acts((2.78, -2.92, 0.0), yaw=-60.0),
    },
    physical=Physical(
        tuple((f"bath_towel/bath_towel_{number:02d}",) for number in (5, 6, 7)),
        near=(Near("bath_towel_0", (3.3, -2.9, 0.95), most=0.55),),
        robots={"fetch": Acts((2.78, -2.92, 0.0), yaw=-60.0, camera_tilt=0.75, camera_pan=1.25)},
    ),
    expert=plan,
    fit=Fit(
        surface="dishwasher_0",
        surfaces=("dishwasher", "bottom_cabinet", "countertop", "console_table"),
        anchor=SINK,
        anchors=("sink",),
        link=LinkKind.WATER_SOURCE,
        heights=(0.7, 1.1),
    ),
)
