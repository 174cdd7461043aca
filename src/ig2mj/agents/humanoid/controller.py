"""The humanoid's 28-number action and its proprioception, with iGibson 2.0.0's semantics.

| numbers | what they add to |
|---|---|
| 0-5 | the body's pose, in its present frame: x, y, z (m), roll, pitch, yaw (rad) |
| 6-11 | the eye's pose in the body's frame |
| 12-17, 18, 19 | the left hand's pose in the body's frame; its trigger (0 open, 1 closed); its reset |
| 20-25, 26, 27 | the same of the right hand |

Poses of hands and eye are remembered as targets in the body's frame, so that a zero action holds them there; the body
has none, so that a zero action leaves it where it is. Turns are about the axes of the body's frame. A reset
above 0 brings a hand's target back to where the hand is at rest; a hand that is out of its arm's reach, because
something holds it back, is put there at once (`ig2mj.worlds.hand_resets`).

Axes: W worlds, 2 hands (left, right), 10 finger joints of a hand.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.agents.base import HandReading
from ig2mj.agents.humanoid.frames import (
    BODY_Z,
    CAMERA_QUAT,
    EYE_POS,
    EYE_REACH,
    FINGER_CLOSED,
    FINGERS,
    GHOST_DISTANCE,
    HAND_POS,
    HAND_QUAT,
    HAND_REACH,
    HANDS,
    MAX_MOVE,
    MAX_TURN,
    NECK_POS,
    SEGMENTS,
    SHOULDER_POS,
    THUMB_CLOSED,
)
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import (
    compose,
    length,
    quat_conjugate,
    quat_multiply,
    quat_normalize,
    quat_to_rotation_vector,
    quat_to_rpy,
    relative_pose,
    rpy_to_quat,
)
from ig2mj.scene.tables import SceneTables

MAX_SPEED, MAX_TURN_RATE = 6.0, 10.0
"""m/s along each axis and rad/s: largest speeds of a hand towards its target. The first is the sum of the largest
commands of hand and body in 1/10 s. Without the limit a blocked hand that comes free far behind its target would rush
there, and throw what it holds or hits out of the house."""

REACH_SLACK = 0.001
"""m by which a target may be out of reach before it is brought back."""

CLOSED = np.array([THUMB_CLOSED] * 2 + [FINGER_CLOSED] * 8, np.float32)
"""[10] rad."""

_POSE = ("x", "y", "z", "roll", "pitch", "yaw")


@struct.dataclass
class HumanoidState:
    """What the controller remembers: targets in the body's frame, and where fingers stand.

    Attributes:
      hand_pos, hand_quat, eye_pos, eye_quat: targets, m and w-x-y-z.
      trigger: 0 open, 1 closed.
      fingers: rad, where they stood at the last action at which the hand held nothing, and are kept while it holds
        something. One action later they are inside of that: contacts with it are dropped while they close, and would
        throw it when it is let go. known: they were read at an action.
    """

    hand_pos: Float[Array, "W 2 3"]
    hand_quat: Float[Array, "W 2 4"]
    eye_pos: Float[Array, "W 3"]
    eye_quat: Float[Array, "W 4"]
    trigger: Float[Array, "W 2"]
    fingers: Float[Array, "W 2 10"]
    known: Bool[Array, "W 2"]


class HumanoidController:
    """See the module's text. `ig2mj.agents.base.Controller`."""

    action_names: tuple[str, ...] = (
        *(f"{part}_{n}" for part in ("body", "eye") for n in _POSE),
        *(f"{hand}_{n}" for hand in HANDS for n in (*_POSE, "trigger", "reset")),
    )

    moves_eye = True

    def __init__(self, tables: SceneTables, agent: int, period: float, grasp_flags: bool = True):
        name = tables.agent_names[agent]
        pose = [MAX_MOVE] * 3 + [MAX_TURN] * 3
        self.action_high: np.ndarray = np.array([*pose, *pose, *pose, 1.0, 1.0, *pose, 1.0, 1.0], np.float32)
        self.action_low: np.ndarray = -self.action_high
        self.agent, self._gain = agent, 1.0 / period
        self._hands = np.flatnonzero(tables.hand_agent == agent)
        self._finger_joints = np.array(
            [
                [tables.agent_joint_names.index(f"{name}_{h}_{f}_{s}_joint") for f in FINGERS for s in SEGMENTS]
                for h in HANDS
            ]
        )
        palms = [f"{name}_{h}" for h in HANDS]
        self.reset_numbers: np.ndarray = np.array([self.action_names.index(f"{h}_reset") for h in HANDS])
        self.hand_qposadr: np.ndarray = tables.agent_joint_qposadr[
            [[tables.agent_joint_names.index(f"{palm}_{axis}") for axis in "xyz"] for palm in palms]
        ]
        self._flags = grasp_flags
        flag = ("is_grasping",) if grasp_flags else ()
        self.proprioception_names: tuple[str, ...] = (
            *(f"{hand}_{n}" for hand in HANDS for n in _POSE),
            *(f"eye_{n}" for n in _POSE),
            *(f"{hand}_{n}" for hand in HANDS for n in ("trigger_fraction", *flag)),
        )
        names = self.proprioception_names
        self.hand_readings: tuple[HandReading, ...] = tuple(
            HandReading(names.index(f"{hand}_is_grasping"), names.index(f"{hand}_x")) for hand in HANDS if grasp_flags
        )

    @property
    def action_size(self) -> int:
        return len(self.action_names)

    def initial(self, num_worlds: int) -> HumanoidState:
        def rows(values: object) -> Float[Array, "W ..."]:
            row = jnp.asarray(values, jnp.float32)
            return jnp.tile(row, (num_worlds, *[1] * row.ndim))

        return HumanoidState(
            hand_pos=rows(HAND_POS),
            hand_quat=rows(HAND_QUAT),
            eye_pos=rows(EYE_POS),
            eye_quat=rows((1.0, 0.0, 0.0, 0.0)),
            trigger=rows(np.zeros(2)),
            fingers=rows(np.zeros((2, 10))),
            known=jnp.zeros((num_worlds, 2), bool),
        )

    def control(
        self, action: Float[Array, "W 28"], view: PhysicsView, state: HumanoidState
    ) -> tuple[Float[Array, "W 38"], HumanoidState]:
        action = jnp.clip(jnp.asarray(action, jnp.float32), self.action_low, self.action_high)
        by_hand = action[:, 12:].reshape(-1, 2, 8)

        turn = rpy_to_quat(action[:, 3:6])
        base_pos, base_quat = view.agent.base_pos[:, self.agent], view.agent.base_quat[:, self.agent]
        body_pos, body_quat = compose(base_pos, base_quat, action[:, :3], turn)
        body_pos = body_pos.at[:, 2].set(jnp.clip(body_pos[:, 2], *BODY_Z))

        eye_pos = _within(state.eye_pos + action[:, 6:9], NECK_POS, EYE_REACH)
        eye_quat = quat_normalize(quat_multiply(rpy_to_quat(action[:, 9:12]), state.eye_quat))
        hand_pos = _within(state.hand_pos + by_hand[..., :3], SHOULDER_POS, HAND_REACH)
        hand_quat = quat_normalize(quat_multiply(rpy_to_quat(by_hand[..., 3:6]), state.hand_quat))
        reset = by_hand[..., 7:] > 0
        hand_pos = jnp.where(reset, jnp.asarray(HAND_POS, jnp.float32), hand_pos)
        hand_quat = jnp.where(reset, jnp.asarray(HAND_QUAT, jnp.float32), hand_quat)
        trigger = jnp.clip(state.trigger + by_hand[..., 6], 0.0, 1.0)

        held = jnp.asarray(view.held)[:, self._hands].any(-1)
        now = jnp.asarray(view.agent.joint_pos)[:, self._finger_joints]
        fingers = jnp.where((held & state.known)[..., None], state.fingers, now)
        new = HumanoidState(hand_pos, hand_quat, eye_pos, eye_quat, trigger, fingers, jnp.ones_like(held))

        target_pos, target_quat = compose(body_pos[:, None], body_quat[:, None], hand_pos, hand_quat)
        hand, ahead = view.agent.hand_pos[:, self._hands], MAX_SPEED / self._gain
        sent_pos = jnp.clip(target_pos, hand - ahead, hand + ahead)
        left = quat_multiply(quat_conjugate(view.agent.hand_quat[:, self._hands]), target_quat)
        ctrl_fingers = jnp.where(held[..., None], fingers, trigger[..., None] * CLOSED)
        ctrl_hands = jnp.concatenate([sent_pos, _turn_rate(left, self._gain), ctrl_fingers], axis=-1)
        ctrl_body = jnp.concatenate([body_pos, _turn_rate(turn, self._gain)], axis=-1)
        return jnp.concatenate([ctrl_body, ctrl_hands.reshape(-1, 32)], axis=-1), new

    def grip(self, state: HumanoidState) -> Float[Array, "W 2"]:
        return state.trigger

    def lag(self, view: PhysicsView, state: HumanoidState) -> Float[Array, "W 2"]:
        """From a hand to its target, as far as the body is where it is now."""
        _, pos, _ = self.ghosts(view, state)
        return length(pos - view.agent.hand_pos[:, self._hands])

    def eye(self, view: PhysicsView, state: HumanoidState) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"]]:
        """The camera where the head was sent: moves with the body, without delay and without mass."""
        base = view.agent.base_pos[:, self.agent], view.agent.base_quat[:, self.agent]
        camera = jnp.asarray(CAMERA_QUAT, jnp.float32)
        return compose(*base, state.eye_pos, quat_multiply(state.eye_quat, jnp.broadcast_to(camera, (1, 4))))

    def out_of_reach(self, view: PhysicsView, state: HumanoidState) -> tuple[Bool[Array, "W 2"], Float[Array, "W 2 3"]]:
        """Hands farther from their shoulders than an arm is long, and where they are pulled to (world frame, m)."""
        base = view.agent.base_pos[:, [self.agent]], view.agent.base_quat[:, [self.agent]]
        upright = jnp.broadcast_to(jnp.array([1.0, 0.0, 0.0, 0.0]), (1, 2, 4))
        shoulders, _ = compose(*base, jnp.asarray(SHOULDER_POS, jnp.float32)[None], upright)
        far = length(view.agent.hand_pos[:, self._hands] - shoulders) > HAND_REACH + 10 * REACH_SLACK
        return far, self.ghosts(view, state)[1]

    def ghosts(
        self, view: PhysicsView, state: HumanoidState
    ) -> tuple[Bool[Array, "W 2"], Float[Array, "W 2 3"], Float[Array, "W 2 4"]]:
        """For people: which hands are far from their targets, and the targets in the world."""
        base = view.agent.base_pos[:, [self.agent]], view.agent.base_quat[:, [self.agent]]
        pos, quat = compose(*base, state.hand_pos, state.hand_quat)
        return length(pos - view.agent.hand_pos[:, self._hands]) > GHOST_DISTANCE, pos, quat

    def proprioception(self, view: PhysicsView, state: HumanoidState) -> Float[Array, "W m"]:
        """Poses in the body's frame; trigger 0 open to 1 closed; 1 for a hand that holds something, else -1."""
        base = view.agent.base_pos[:, [self.agent]], view.agent.base_quat[:, [self.agent]]
        pos, quat = relative_pose(*base, view.agent.hand_pos[:, self._hands], view.agent.hand_quat[:, self._hands])
        hands = jnp.concatenate([pos, quat_to_rpy(quat)], axis=-1).reshape(-1, 12)
        ends = [state.trigger[..., None]]
        if self._flags:
            holds = jnp.asarray(view.held)[:, self._hands].any(-1)
            ends.append(jnp.where(holds, 1.0, -1.0)[..., None])
        ends = jnp.concatenate(ends, axis=-1).reshape(hands.shape[0], -1)
        return jnp.concatenate([hands, state.eye_pos, quat_to_rpy(state.eye_quat), ends], axis=-1)


def _within(pos: Float[Array, "*b 3"], centre: np.ndarray, reach: float) -> Float[Array, "*b 3"]:
    """Targets in the body's frame, those out of reach brought back onto the sphere."""
    middle = jnp.asarray(centre, jnp.float32)
    offset = pos - middle
    far = length(offset)[..., None]
    return jnp.where(far > reach + REACH_SLACK, middle + offset * (reach / jnp.maximum(far, 1e-6)), pos)


def _turn_rate(left: Float[Array, "*b 4"], gain: float) -> Float[Array, "*b 3"]:
    """Angular velocity in the body's frame that makes the turn `left` in the time 1 / `gain`."""
    rate = gain * quat_to_rotation_vector(left)
    return rate * jnp.minimum(1.0, MAX_TURN_RATE / jnp.maximum(length(rate), 1e-6))[..., None]
