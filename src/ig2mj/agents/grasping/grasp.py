"""Assistive grasping: a closing hand takes hold of what is in it by an equality constraint (paper, appendix A.1).

A hand that is asked to close by more than half takes hold of the nearest body that is between palm and fingers and that
a finger presses on. The constraint is switched on with the present pose, so that nothing jumps; contacts of the hand
with the object are dropped while it is held. It lets go when it is asked to open, or when what it holds is too much:

- the two anchor points of the constraint are `MAX_DISTANCE` apart (the paper's 10 cm), or
- the hand stays `MAX_DISTANCE` behind where it is pulled to, for `STRAIN_STEPS` steps: its force is not enough for
  what it holds. MuJoCo's constraints have no limit like iGibson's 500 and 350 N. Here distance is what breaks a grasp,
  and the hand's own 300 N are what bounds its force.

Modes (iGibson's manipulation_robot.py): "physical" never holds; "assisted" as above; "sticky" without the rays;
"mitten" takes hold of the first of its targets that it touches, open or closed, and never lets go.

A grasp also ends from outside, in every mode: what is held, or the hand, moves by other means than physics (a teleport,
a cut, sampling), and the engine switches its constraint off (`ig2mj.engine.base.Write`). An assisted or sticky hand
that is still asked to close takes hold again of what its fingers press on; a mitten waits until it touches none of its
targets.

Axes: W worlds, H hands, Y graspable bodies, O objects, E equality constraints.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.agents.base import Robot
from ig2mj.agents.grasping.candidates import Candidates
from ig2mj.engine.base import Write
from ig2mj.engine.model_fields import ModelFields
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.geometry.poses import length, quat_rotate, relative_pose
from ig2mj.scene.grasp_equalities import equality_name
from ig2mj.scene.scene import Scene

MODES = ("physical", "assisted", "sticky", "mitten")

TRIGGER = 0.5
"""Share of the way that a hand must be asked to close."""

MAX_DISTANCE = 0.1
"""m: the paper's DAGMax."""

STRAIN_STEPS = 3
"""Control steps: a tenth of a second, in which a jerk that the hand can follow is over."""

MITTEN_REACH = 0.1
"""m from the grasp point to an object's box at which a touch of the agent is taken for the hand's."""

NOTHING = -1

WAITS = -1
"""`GraspState.window` of a mitten whose grasp was ended from outside, until it touches none of its targets."""


@struct.dataclass
class GraspState:
    """What hands hold.

    Attributes:
      body: Y of what is held, or being let go of; -1 none. held: the constraint is on.
      local: its parameters (MuJoCo's eq_data without torque scale): anchor on the second body, or on the first for a
        connect; anchor on the other; relative orientation.
      window: control steps for which contacts are still dropped after letting go; `WAITS`: nothing is taken hold of.
      strain: steps behind the target.
    """

    body: Int[Array, "W H"]
    held: Bool[Array, "W H"]
    local: Float[Array, "W H 10"]
    window: Int[Array, "W H"]
    strain: Int[Array, "W H"]


class Grasping:
    """The rule for all hands of a scene. All methods but the constructor are pure and batched.

    Attributes:
      mode: one of `MODES`. active: something can be held at all.
    """

    def __init__(self, scene: Scene, mode: str = "assisted", targets: str | Sequence[str] = ()):
        """
        Args:
          scene: with its robots.
          mode: one of `MODES`.
          targets: objects that mittens stick to, or a single one.

        Raises:
          UnknownNameError: there is no such mode or object. EngineError: a robot's hands have no rays, or mittens no
            targets.
        """
        if mode not in MODES:
            raise UnknownNameError("grasping mode", mode, MODES)
        if mode == "mitten" and not targets:
            raise EngineError("mitten grasping needs target objects: Grasping(scene, 'mitten', targets=[...])")
        targets = (targets,) if isinstance(targets, str) else targets
        self.mode, self.scene = mode, scene
        tables, model = scene.tables, scene.model
        hands = [h for a in scene.agents if isinstance(a, Robot) for h in a.hand_rays()]
        names = [model.body(int(b)).name for b in tables.hand_body]
        by_palm = {h.palm: h for h in hands}
        missing = [n for n in names if n not in by_palm]
        if missing and mode != "physical":
            raise EngineError(f"hand '{missing[0]}' cannot take part in {mode} grasping: its robot has no `hand_rays`")
        self.active = mode != "physical" and bool(names) and len(tables.graspable_body) > 0
        if not self.active:
            return
        hands = [by_palm[n] for n in names]
        parts = {b for h in hands for b in (h.palm, *h.start_bodies, *h.end_bodies)}
        self._candidates = Candidates(tables, hands, {b: model.body(b).id for b in parts})
        bodies = [model.body(int(b)).name for b in tables.graspable_body]
        equality = [[_equality(model, hand, body) for body in bodies] for hand in names]
        self._equality = np.array(equality)
        self._connect = tables.graspable_joint >= 0
        self._targets = np.isin(tables.graspable_object, [scene.object_index(t) for t in targets])
        self._object = tables.graspable_object[None, :] == np.arange(tables.num_objects)[:, None]  # [O, Y]

    def initial(self, num_worlds: int) -> GraspState:
        """Empty hands."""
        shape = (num_worlds, len(self.scene.tables.hand_body))
        zero = jnp.zeros(shape, jnp.int32)
        return GraspState(
            zero - 1, jnp.zeros(shape, bool), jnp.zeros((*shape, 10), jnp.float32), zero, jnp.zeros(shape, jnp.int32)
        )

    def update(
        self, view: PhysicsView, state: GraspState, grip: Float[Array, "W H"], lag: Float[Array, "W H"]
    ) -> GraspState:
        """Takes hold and lets go; once every control step, after physics.

        Args:
          grip: how far each hand is asked to close (`Controller.grip`), of all robots.
          lag: m by which each hand is behind its target (`Controller.lag`).
        """
        if not self.active:
            return state
        waited = state.window == WAITS
        state = self.ended(state, view.held)
        held, strain = state.held, jnp.where(state.held & (lag > MAX_DISTANCE), state.strain + 1, 0)
        if self.mode == "mitten":
            lets_go = jnp.zeros_like(held)
        else:
            apart = self._distance(view, state) > MAX_DISTANCE
            lets_go = held & ((grip <= TRIGGER) | apart | (strain >= STRAIN_STEPS))
        touched = self._touched(view)
        waits = (state.window == WAITS) & (~waited | touched.any(-1))  # contacts are known one step after the release
        window = jnp.where(waits, WAITS, jnp.where(lets_go, 1, jnp.maximum(state.window - 1, 0)))
        body = jnp.where(held | (window > 0), state.body, NOTHING)
        free = body == NOTHING

        wants = free & (state.window == 0) & ((self.mode == "mitten") | (grip > TRIGGER))
        allowed = touched & wants[..., None]
        found, takes = jax.lax.cond(  # most of the time no hand closes on anything
            allowed.any(),
            lambda: self._candidates.nearest(view, allowed, rays=self.mode == "assisted"),
            lambda: (jnp.zeros(wants.shape, jnp.int32), jnp.zeros(wants.shape, bool)),
        )
        body = jnp.where(takes, found, body)
        local = jnp.where(takes[..., None], self._parameters(view, found), state.local)
        return GraspState(body, (held & ~lets_go) | takes, local, window, jnp.where(lets_go | takes, 0, strain))

    def ended(self, state: GraspState, held: Bool[Array, "W H O"]) -> GraspState:
        """The state without grasps whose constraints were switched off by something else than `update`.

        Args:
          held: of the view.
        """
        if not self.active:
            return state
        thing = jnp.asarray(self.scene.tables.graspable_object)[jnp.maximum(state.body, 0)]
        over = state.held & ~jnp.take_along_axis(jnp.asarray(held), thing[..., None], axis=-1)[..., 0]
        return GraspState(
            body=jnp.where(over, NOTHING, state.body),
            held=state.held & ~over,
            local=state.local,
            window=jnp.where(over, WAITS if self.mode == "mitten" else 0, state.window),
            strain=jnp.where(over, 0, state.strain),
        )

    def idle(self, view: PhysicsView, state: GraspState) -> bool:
        """On the host: nothing is held, no hand waits and none touches anything, so that `update` would change nothing
        whatever the hands are commanded. True in most steps; the check costs far less than a program."""
        if (np.asarray(state.body) != NOTHING).any() or (np.asarray(state.window) == WAITS).any():
            return False
        pressed, touching = np.asarray(view.agent.finger_force), np.asarray(view.agent.touching)
        if self.mode != "mitten":
            return not pressed.any()
        if pressed.any() and pressed[..., self._targets].any():
            return False
        return not (touching.any() and touching[..., self.scene.tables.graspable_object[self._targets]].any())

    def changed(self, before: GraspState, after: GraspState) -> Bool[Array, "W"]:
        """Worlds whose constraints or dropped contacts differ, for which `write` is needed."""
        differs = (before.body != after.body) | (before.held != after.held)
        return differs.any(1)

    def write(self, state: GraspState) -> Write:
        """The change to physics that makes these grasps: constraints, their parameters, contacts dropped."""
        worlds, model = state.body.shape[0], self.scene.model
        active = jnp.tile(jnp.asarray(model.eq_active0, bool), (worlds, 1))
        data = jnp.tile(jnp.asarray(model.eq_data[:, :12], jnp.float32), (worlds, 1, 1))
        ignored = jnp.zeros((worlds, state.body.shape[1], self.scene.tables.num_objects), bool)
        if self.active:
            row = jnp.arange(worlds)[:, None]
            equality = jnp.asarray(self._equality)[np.arange(state.body.shape[1])[None], jnp.maximum(state.body, 0)]
            at = jnp.where(state.held, equality, model.neq)  # out of range: dropped
            active = active.at[row, at].set(True, mode="drop")
            data = data.at[row, at, :10].set(state.local, mode="drop")
            ignored = jnp.asarray(self._object).T[jnp.maximum(state.body, 0)] & (state.body >= 0)[..., None]
        return Write(eq_active=active, model_fields=ModelFields(eq_data=data), ignored_contacts=ignored)

    def read(
        self, eq_active: Bool[Array, "W E"], eq_data: Float[Array, "W E 12"], ignored_contacts: Bool[Array, "W H O"]
    ) -> GraspState:
        """What hands hold in worlds that were loaded or changed by hand: the constraints that are on.

        What a hand ignores without holding it is being let go of.

        Args:
          eq_active, eq_data, ignored_contacts: of a `Snapshot` with the world axis.
        """
        state = self.initial(eq_active.shape[0])
        if not self.active:
            return state
        on = jnp.asarray(eq_active, bool)[:, self._equality]  # [W, H, Y]
        held, body = on.any(-1), jnp.argmax(on, axis=-1).astype(jnp.int32)
        leaving = jnp.asarray(ignored_contacts, bool)[..., self.scene.tables.graspable_object] & ~held[..., None]
        leaves = leaving.any(-1)
        body = jnp.where(leaves, jnp.argmax(leaving, axis=-1).astype(jnp.int32), body)
        equality = jnp.asarray(self._equality)[np.arange(body.shape[1])[None], body]
        local = jnp.take_along_axis(jnp.asarray(eq_data, jnp.float32)[..., :10], equality[..., None], axis=1)
        body, local = jnp.where(held | leaves, body, NOTHING), jnp.where(held[..., None], local, 0.0)
        return GraspState(body, held, local, jnp.where(leaves, 1, state.window), state.strain)

    def loaded(self, before: GraspState, found: GraspState) -> GraspState:
        """What hands hold in loaded worlds, which is what `read` found there; mittens wait where they held something
        `before`."""
        if self.mode != "mitten":
            return found
        return dataclasses.replace(found, window=jnp.where(before.held & ~found.held, WAITS, found.window))

    def _touched(self, view: PhysicsView) -> Bool[Array, "W H Y"]:
        """What each hand presses on; for a mitten, which of its targets it touches at all."""
        touched = self._candidates.touched(view)
        if self.mode != "mitten":
            return touched
        tables = self.scene.tables
        point = self._candidates.grasp_points(view)[:, :, None]
        low, high = jnp.asarray(view.aabb_low)[:, None], jnp.asarray(view.aabb_high)[:, None]
        near = length(jnp.maximum(0, jnp.maximum(low - point, point - high))) < MITTEN_REACH  # [W, H, O]
        near &= jnp.asarray(view.agent.touching)[:, tables.hand_agent]
        return (touched | near[..., tables.graspable_object]) & jnp.asarray(self._targets)

    def _poses(self, view: PhysicsView, body: Int[Array, "W H"]):
        """Poses of the palms and of the bodies that they hold, or would."""
        tables = self.scene.tables
        ids = jnp.asarray(tables.graspable_body)[jnp.maximum(body, 0)]
        row = np.arange(body.shape[0])[:, None]
        pos, quat = jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)
        return pos[:, tables.hand_body], quat[:, tables.hand_body], pos[row, ids], quat[row, ids]

    def _parameters(self, view: PhysicsView, body: Int[Array, "W H"]) -> Float[Array, "W H 10"]:
        """eq_data of a grasp at the present pose, whose anchor is the grasp point."""
        hand_pos, hand_quat, pos, quat = self._poses(view, body)
        anchor = self._candidates.grasp_points(view)
        unit = jnp.broadcast_to(jnp.array([1.0, 0.0, 0.0, 0.0]), quat.shape)
        on_hand, _ = relative_pose(hand_pos, hand_quat, anchor, unit)
        on_body, _ = relative_pose(pos, quat, anchor, unit)
        _, turned = relative_pose(hand_pos, hand_quat, pos, quat)
        connect = jnp.asarray(self._connect)[jnp.maximum(body, 0)][..., None]
        first, second = jnp.where(connect, on_hand, on_body), jnp.where(connect, on_body, on_hand)
        return jnp.concatenate([first, second, turned], axis=-1)

    def _distance(self, view: PhysicsView, state: GraspState) -> Float[Array, "W H"]:
        """m between the two anchors."""
        hand_pos, hand_quat, pos, quat = self._poses(view, state.body)
        connect = jnp.asarray(self._connect)[jnp.maximum(state.body, 0)][..., None]
        first, second = state.local[..., :3], state.local[..., 3:6]
        on_hand, on_body = jnp.where(connect, first, second), jnp.where(connect, second, first)
        return length(hand_pos + quat_rotate(hand_quat, on_hand) - pos - quat_rotate(quat, on_body))


def _equality(model: mujoco.MjModel, hand: str, body: str) -> int:
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_EQUALITY, equality_name(hand, body))
    if number < 0:
        raise EngineError(f"hand '{hand}' has no constraint to hold '{body}' by: its agent's entry is not `assisted`")
    return number
