"""What `grasping.py` sees of energy: does anything gain more of it than the robot's servos can have given?

Two looks at it, after every control step:

- *Kinetic energy of an object*, the largest in each world, by what became of the object (`CLASSES`) and by quarter of
  the episode. An engine that feeds energy into what is held shows in later quarters, or where it is let go.
- *Balance*: what loose objects and the robot have, kinetic and potential, rises in a control step by the work of the
  servos at most, bounded here by the larger of each one's forces before and after the step times the larger speed of
  its joint. What rises more came from overlaps that were pressed together earlier, from a peak of force within the
  step, or from nowhere.

The robot's kinetic energy is that of its joint-space inertia's diagonal at the model's zero; an object's that of its
main body with the mass of the whole. Joules. Axes: W worlds, O objects, C classes, Q quarters, B bins.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from benchmarks.soak.watch import NEVER
from ig2mj.engine.base import Engine
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_multiply, quat_rotate_inverse

CLASSES = ("never held", "taken in this step", "held", "let go up to 1 s ago", "held before")
"""Of an object in a control step."""

JUST = 30
"""Control steps of "let go up to 1 s ago"."""

QUARTERS = 4
"""Parts of an episode."""

EDGES = np.logspace(-6, 4, 81)
"""Bounds of the bins, eight for each factor of ten."""

RISES = (0.0, 1.0, 10.0)
"""Rises above the servos' work that are counted."""


@struct.dataclass
class Energy:
    """What was seen so far, and what is compared in the next step.

    Attributes:
      counts: worlds and steps by class, quarter and bin of the largest kinetic energy. most: the largest of a class.
      thing: object that had it. beyond: worlds and steps in which energy rose above the servos' work, by `RISES`.
      rise, riser: the largest such rise, and the object that gained most in it. steps: worlds and steps compared.
      total: of each world after the last step; not finite: not to be compared. own: of each object.
      force, speed: of the servos on each degree of freedom (N, N m), and its speed, after the last step.
    """

    counts: Int[Array, "C Q B"]
    most: Float[Array, "C"]
    thing: Int[Array, "C"]
    beyond: Int[Array, "3"]
    rise: Float[Array, ""]
    riser: Int[Array, ""]
    steps: Int[Array, ""]
    total: Float[Array, "W"]
    own: Float[Array, "W O"]
    force: Float[Array, "W nv"]
    speed: Float[Array, "W nv"]


class EnergyWatch:
    """Looks at energies of an engine's worlds; `look` is pure where the engine is. `episode`: its control steps."""

    def __init__(self, engine: Engine, loose: Bool[np.ndarray, "O"], episode: int):
        self._engine, self._loose, self._episode = engine, loose, episode
        model, tables = engine.scene.model, engine.tables
        self._gravity = float(-model.opt.gravity[2])
        self._mass = np.where(loose, tables.object_mass, 0.0).astype(np.float32)
        self._inertia = np.where(loose[:, None], model.body_inertia[tables.object_root], 0.0).astype(np.float32)
        self._turn = model.body_iquat[tables.object_root].astype(np.float32)
        robot = np.asarray(tables.body_agent) >= 0
        self._robot_mass = np.where(robot, model.body_mass * (1 - model.body_gravcomp), 0.0).astype(np.float32)
        of_robot = robot[model.dof_bodyid]
        self._robot_inertia = np.where(of_robot, model.dof_M0, 0.0).astype(np.float32)
        self._seconds = engine.substeps * engine.timestep

    def start(self) -> Energy:
        """Nothing was seen yet."""
        zero, worlds = jnp.zeros((), jnp.int32), self._engine.num_worlds
        classes, objects = len(CLASSES), len(self._mass)
        return Energy(
            jnp.zeros((classes, QUARTERS, len(EDGES) + 1), jnp.int32),
            jnp.zeros(classes, jnp.float32),
            jnp.zeros(classes, jnp.int32),
            jnp.zeros(len(RISES), jnp.int32),
            jnp.full((), -jnp.inf, jnp.float32),
            zero,
            zero + 0,
            jnp.full(worlds, jnp.inf, jnp.float32),
            jnp.zeros((worlds, objects), jnp.float32),
            *(jnp.zeros((worlds, len(self._robot_inertia)), jnp.float32) for _ in range(2)),
        )

    def fresh(self, seen: Energy, mask: Bool[Array, "W"]) -> Energy:
        """The masked worlds begin a new episode."""
        return dataclasses.replace(seen, total=jnp.where(mask, jnp.inf, seen.total))

    def look(
        self,
        seen: Energy,
        physics: Any,
        view: PhysicsView,
        before: Int[Array, "W O"],
        since: Int[Array, "W O"],
        sound: Bool[Array, "W"],
        used: Bool[Array, "W O"],
        cut: Bool[Array, "W"],
        step: Int[Array, "W"],
    ) -> Energy:
        """After a control step.

        Args:
          before, since: control steps since each object was held, before and after it (`soak_watch.Seen`).
          sound: worlds that were not flagged. used: objects that are not parked. cut: something was cut just now.
          step: control steps since the episode's start.
        """
        kinetic = jnp.where(used & self._loose, self._kinetic(view), 0.0)
        held, was = since == 0, before == 0
        kind = jnp.where(since >= NEVER, 0, jnp.where(held, jnp.where(was, 2, 1), jnp.where(since <= JUST, 3, 4)))
        of_class = kind[..., None] == jnp.arange(len(CLASSES))
        largest = jnp.where(of_class & (self._loose & sound[:, None])[..., None], kinetic[..., None], -1.0)  # [W, O, C]
        most = largest.max(1)
        bins = jnp.searchsorted(jnp.asarray(EDGES, jnp.float32), most)
        quarter = jnp.clip(step * QUARTERS // self._episode, 0, QUARTERS - 1)
        one = (bins[..., None] == jnp.arange(len(EDGES) + 1)) & (most >= 0)[..., None]  # [W, C, B]
        when = quarter[:, None] == jnp.arange(QUARTERS)
        counts = jnp.einsum("wcb,wq->cqb", one.astype(jnp.float32), when.astype(jnp.float32)).astype(jnp.int32)
        top = most.max(0)
        thing = largest.argmax(1)[most.argmax(0), jnp.arange(len(CLASSES))].astype(jnp.int32)

        own = kinetic + jnp.where(used, self._potential(view), 0.0)
        speed = jnp.asarray(self._engine.snapshot(physics).whole("qvel"), jnp.float32)
        robot = 0.5 * (self._robot_inertia * speed**2).sum(1)
        robot += self._gravity * (self._robot_mass * jnp.asarray(view.body_pos)[..., 2]).sum(1)
        force, total = self._force(physics), own.sum(1) + robot
        power = jnp.maximum(jnp.abs(force), jnp.abs(seen.force)) * jnp.maximum(jnp.abs(speed), jnp.abs(seen.speed))
        rise = total - seen.total - self._seconds * power.sum(1)
        compared = jnp.isfinite(rise) & sound & ~cut
        rise = jnp.where(compared, rise, -jnp.inf)
        world = rise.argmax()
        larger = rise[world] > seen.rise
        return Energy(
            counts=seen.counts + counts,
            most=jnp.maximum(seen.most, top),
            thing=jnp.where(top > seen.most, thing, seen.thing),
            beyond=seen.beyond + (rise[:, None] > jnp.asarray(RISES)).sum(0).astype(jnp.int32),
            rise=jnp.maximum(seen.rise, rise[world]),
            riser=jnp.where(larger, (own - seen.own)[world].argmax().astype(jnp.int32), seen.riser),
            steps=seen.steps + compared.sum().astype(jnp.int32),
            total=total,
            own=own,
            force=force,
            speed=speed,
        )

    def of_objects(self, view: PhysicsView) -> Float[Array, "W"]:
        """Kinetic and potential energy of all loose objects together."""
        return jnp.where(self._loose, self._kinetic(view) + self._potential(view), 0.0).sum(-1)

    def _potential(self, view: PhysicsView) -> Float[Array, "W O"]:
        return self._mass * self._gravity * jnp.asarray(view.object_com)[..., 2]

    def _force(self, physics: Any) -> Float[Array, "W nv"]:
        """What the servos did in the last physics step."""
        if self._engine.pure:
            return jnp.asarray(physics.data.qfrc_actuator, jnp.float32)
        each = [self._engine.to_mujoco(physics, w)[1].qfrc_actuator for w in range(self._engine.num_worlds)]
        return jnp.asarray(np.array(each), jnp.float32)

    def _kinetic(self, view: PhysicsView) -> Float[Array, "W O"]:
        turn, quat = jnp.asarray(view.object_angvel), jnp.asarray(view.object_quat)
        arm = jnp.asarray(view.object_com) - jnp.asarray(view.object_pos)
        velocity = jnp.asarray(view.object_linvel) + jnp.cross(turn, arm)
        inside = quat_rotate_inverse(quat_multiply(quat, jnp.asarray(self._turn)), turn)
        return 0.5 * (self._mass * (velocity**2).sum(-1) + (self._inertia * inside**2).sum(-1))

    def report(self, seen: Energy) -> dict[str, Any]:
        """What was seen, for people: quantiles are upper bounds of bins."""
        names, counts = self._engine.tables.object_names, np.asarray(seen.counts)
        kinds = {}
        for k, kind in enumerate(CLASSES):
            if counts[k].sum() == 0:
                continue
            kinds[kind] = {
                "world_steps": int(counts[k].sum()),
                "p99_by_quarter": [_quantile(c, 0.99) for c in counts[k]],
                "p99.99_by_quarter": [_quantile(c, 0.9999) for c in counts[k]],
                "median": _quantile(counts[k].sum(0), 0.5),
                "most": round(float(seen.most[k]), 3),
                "most_of": names[int(seen.thing[k])],
            }
        return {
            "largest_kinetic_energy_J": kinds,
            "control_steps_compared": int(seen.steps),
            "rose_beyond_servos_work": {f"{r:g} J": int(n) for r, n in zip(RISES, seen.beyond, strict=True)},
            "largest_rise_beyond_J": round(float(seen.rise), 3),
            "largest_rise_of": names[int(seen.riser)],
        }


def _quantile(counts: np.ndarray, share: float) -> float | None:
    total = counts.sum()
    if total == 0:
        return None
    k = int(np.searchsorted(np.cumsum(counts), share * total))
    return float(f"{EDGES[min(k, len(EDGES) - 1)]:.3g}")
