"""Checks that move objects: does the scene come to rest, does each joint go through its range."""

from __future__ import annotations

import math
import time

import mujoco
import numpy as np

from ig2mj.scene.manifest import Manifest

from ..base.outcome import CheckResult
from ..mjcf.model_index import ModelIndex
from .still import awake_copy, deep_pairs, start_data

SETTLE_TIME = 1.0
"""Seconds."""
DRIFT_TOLERANCE = 0.02
"""Metres a loose object may move in that time."""

SWEEP_TIME = 2.0
"""Seconds a joint has for its range, each way."""
GENTLE = 10.0
"""N or N m that push a joint beyond its own dry friction and what its inertia takes."""
SWEPT = 0.97
"""This share of the range counts as all of it."""
SPREAD = 100.0
"""Metres between objects while their joints are swept."""
FRACTIONS = (0.0, 0.33, 0.66, 1.0)
"""Where in their ranges all joints of an object are looked at together for contact among its own parts."""
CLEARANCE = 1e-4
"""Metres of new overlap with something fixed that count as blocked: a door that much too wide for its corner jams."""
LOOKS_PER_RADIAN, LOOKS_PER_METRE = 40, 40
"""How often a joint is looked at on its way. A door's far corner reaches beyond its closed place only from its first
to its eighth degree or so, and widest at half of that."""
NO_JOINTS = "there are no joints"


def check_settle(model: mujoco.MjModel, manifest: Manifest, index: ModelIndex) -> CheckResult:
    """How far the middle of mass of each loose object moves in the first second."""
    data = start_data(model)
    mujoco.mj_forward(model, data)
    before = data.subtree_com.copy()
    mujoco.mj_step(model, data, max(1, round(SETTLE_TIME / model.opt.timestep)))
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    moved = data.subtree_com - before
    bad = [
        w for w in ("BADQPOS", "BADQVEL", "BADQACC") if data.warning[getattr(mujoco.mjtWarning, f"mjWARN_{w}")].number
    ]
    failures, measured, loose = [], {}, 0
    if bad:
        failures.append({"problem": f"the simulation became unstable ({', '.join(bad)})"})
    for number, entry in enumerate(manifest.objects):
        for body in index.roots[number]:
            if entry.parked or model.body_weldid[body] == 0:
                continue
            loose += 1
            drift, down = float(np.linalg.norm(moved[body])), float(-moved[body, 2])
            name = model.body(body).name
            measured[name] = {"drift": drift, "down": down}
            if not drift < DRIFT_TOLERANCE:
                failures.append(
                    {"object": entry.name, "body": name, "drift": drift, "down": down, "problem": _fell(drift, down)}
                )
    failures.sort(key=lambda f: -f.get("drift", np.inf))
    calm = loose - sum("drift" in f for f in failures)
    if not loose and not failures:
        return CheckResult("settle", True, "nothing is loose")
    text = f"{calm} of {loose} loose objects move less than {DRIFT_TOLERANCE * 100:g} cm in {SETTLE_TIME:g} s"
    return CheckResult("settle", not failures, text, failures, measured)


def _fell(drift: float, down: float) -> str:
    way = "down" if down > 0.9 * drift else ("up" if down < -0.9 * drift else "sideways")
    return f"moved {drift * 100:.1f} cm, mostly {way}"


def check_joints(model: mujoco.MjModel, manifest: Manifest, index: ModelIndex) -> list[CheckResult]:
    """The checks "joint_sweep", "self_contact" and "joint_clearance"."""
    started = time.perf_counter()
    isolated = _Isolated(model, index)
    reached, touching = isolated.sweep()
    sweep = _sweep_result(model, index, reached)
    sweep.seconds = time.perf_counter() - started
    started = time.perf_counter()
    mine = _self_contact_result(model, index, touching | isolated.touching_at_fractions())
    mine.seconds = time.perf_counter() - started
    started = time.perf_counter()
    clear = check_clearance(model, manifest, index)
    clear.seconds = time.perf_counter() - started
    return [sweep, mine, clear]


class _Isolated:
    """A copy of the model without gravity in which every object with joints stands alone, far from the others.

    All objects are swept in one simulation, one joint of each at a time; all other degrees of freedom are put back
    after every step.
    """

    def __init__(self, model: mujoco.MjModel, index: ModelIndex):
        self.model, self.index = awake_copy(model), index
        self.model.opt.gravity[:] = 0
        self.model.dof_armature[:] = model.dof_armature
        self.owners = [o for o, joints in enumerate(index.joints) if joints]
        alone = np.isin(index.geom_object, self.owners)
        self.model.geom_contype[~alone] = 0
        self.model.geom_conaffinity[~alone] = 0
        self.home = self.model.qpos0.copy()
        for place, owner in enumerate(self.owners):
            for piece, body in enumerate(index.roots[owner]):
                where = np.array([SPREAD * place, SPREAD * piece, SPREAD])
                self.model.body_pos[body] = where
                joint = self.model.body_jntadr[body]
                if joint >= 0 and self.model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_FREE):
                    start = self.model.jnt_qposadr[joint]
                    self.home[start : start + 3] = where
        for joints in index.joints:
            for j in joints:
                low, high = self._range(j)
                self.home[self.model.jnt_qposadr[j]] = min(max(0.0, low), high)

    def _range(self, joint: int) -> tuple[float, float]:
        if not self.model.jnt_limited[joint]:
            return 0.0, 2 * np.pi if self.model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_HINGE) else 1.0
        low, high = self.model.jnt_range[joint]
        return float(low), float(high)

    def sweep(self) -> tuple[dict[int, float], set[tuple[int, int]]]:
        """Share of its range that each joint went through, both ways; and (geom, geom) of one tree that touched."""
        reached: dict[int, float] = {}
        touching: set[tuple[int, int]] = set()
        rounds = max((len(self.index.joints[o]) for o in self.owners), default=0)
        for turn in range(rounds):
            joints = np.array([self.index.joints[o][turn] for o in self.owners if len(self.index.joints[o]) > turn])
            up, met = self._push(joints, upward=True)
            down, met_too = self._push(joints, upward=False)
            reached.update(zip(joints.tolist(), np.minimum(up, down).tolist(), strict=True))
            touching |= met | met_too
        return reached, touching

    def _push(self, joints: np.ndarray, *, upward: bool) -> tuple[np.ndarray, set[tuple[int, int]]]:
        m = self.model
        data = mujoco.MjData(m)
        data.qpos[:] = self.home
        q, v = m.jnt_qposadr[joints], m.jnt_dofadr[joints]
        low, high = np.array([self._range(j) for j in joints]).T
        span = np.maximum(high - low, 1e-9)
        data.qpos[q] = low if upward else high
        free = self._coupled(joints)
        held_q = np.ones(m.nq, bool)
        held_q[m.jnt_qposadr[free]] = False
        held_v = np.ones(m.nv, bool)
        held_v[m.jnt_dofadr[free]] = False
        sign = 1.0 if upward else -1.0
        speed = sign * 1.5 * span / SWEEP_TIME
        mujoco.mj_forward(m, data)
        inertia = m.dof_M0[v] + m.dof_armature[v]
        most = m.dof_frictionloss[v] + GENTLE + 20 * inertia * span / SWEEP_TIME**2
        steps = max(1, round(SWEEP_TIME / m.opt.timestep))
        best = np.zeros(len(joints))
        touching: set[tuple[int, int]] = set()
        for step in range(steps):
            share = min(1.0, 4 * (step + 1) / steps)  # grows slowly, then stays
            limit = m.dof_frictionloss[v] + share * (most - m.dof_frictionloss[v])
            wished = inertia * (speed - data.qvel[v]) / (5 * m.opt.timestep) + sign * m.dof_frictionloss[v]
            wished += m.dof_damping[v] * speed
            data.qfrc_applied[v] = np.clip(wished, -limit, limit)
            mujoco.mj_step(m, data)
            data.qpos[held_q] = self.home[held_q]
            data.qvel[held_v] = 0
            gone = (data.qpos[q] - low) / span if upward else (high - data.qpos[q]) / span
            best = np.maximum(best, gone)
            touching |= self._inner_contacts(data)
            if np.all(best >= SWEPT):
                break
        return np.minimum(best, 1.0), touching

    def _coupled(self, joints: np.ndarray) -> np.ndarray:
        """The joints and all that are tied to them by joint equalities (mimic)."""
        m, free = self.model, set(joints.tolist())
        ties = [
            {int(m.eq_obj1id[e]), int(m.eq_obj2id[e])}
            for e in range(m.neq)
            if m.eq_type[e] == int(mujoco.mjtEq.mjEQ_JOINT) and m.eq_obj2id[e] >= 0
        ]
        for _ in ties:
            for tie in ties:
                if tie & free:
                    free |= tie
        return np.array(sorted(free))

    def _inner_contacts(self, data: mujoco.MjData) -> set[tuple[int, int]]:
        if not data.ncon:
            return set()
        geoms = data.contact.geom
        trees = self.index.geom_root[geoms]
        inner = geoms[(trees[:, 0] == trees[:, 1]) & (trees[:, 0] >= 0)]
        return {(int(a), int(b)) for a, b in inner}

    def touching_at_fractions(self) -> set[tuple[int, int]]:
        """(geom, geom) of one tree that touch with all joints at the same share of their ranges."""
        data = mujoco.MjData(self.model)
        touching: set[tuple[int, int]] = set()
        for share in FRACTIONS:
            data.qpos[:] = self.home
            for joints in self.index.joints:
                for j in joints:
                    low, high = self._range(j)
                    data.qpos[self.model.jnt_qposadr[j]] = low + share * (high - low)
            mujoco.mj_fwdPosition(self.model, data)
            touching |= self._inner_contacts(data)
        return touching


def _sweep_result(model: mujoco.MjModel, index: ModelIndex, reached: dict[int, float]) -> CheckResult:
    failures, measured = [], {}
    for joint, share in sorted(reached.items()):
        name = model.joint(joint).name
        measured[name] = share
        if share < SWEPT:
            owner = index.name(int(index.body_object[model.jnt_bodyid[joint]]))
            problem = f"{name} jams after {share:.0%} of its range"
            failures.append({"object": owner, "joint": name, "reached": share, "problem": problem})
    text = f"{len(reached) - len(failures)} of {len(reached)} joints go through their range" if reached else NO_JOINTS
    return CheckResult("joint_sweep", not failures, text, failures, measured)


def _self_contact_result(model: mujoco.MjModel, index: ModelIndex, touching: set[tuple[int, int]]) -> CheckResult:
    failures = []
    for a, b in sorted(touching):
        names = [model.geom(g).name or f"geom {g}" for g in (a, b)]
        problem = f"{names[0]} touches {names[1]}"
        failures.append({"object": index.name(int(index.geom_object[a])), "geoms": names, "problem": problem})
    text = f"{len(touching)} pairs of geoms of one object touch" if touching else "no object touches itself"
    return CheckResult("self_contact", not failures, text, failures)


def check_clearance(model: mujoco.MjModel, manifest: Manifest, index: ModelIndex) -> CheckResult:
    """Which joints cannot go through their range where they stand, because something fixed is in the way."""
    fixed = {number for number, entry in enumerate(manifest.objects) if entry.fixed}
    model = awake_copy(model)
    data = start_data(model)
    start = data.qpos.copy()
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    usual = {frozenset(pair[:2]) for pair in deep_pairs(data, index, CLEARANCE)}
    failures = []
    count = 0
    for owner, joints in enumerate(index.joints):
        for joint in joints:
            count += 1
            if not model.jnt_limited[joint]:
                continue
            low, high = model.jnt_range[joint]
            data.qpos[:] = start
            for share in _looks(model, joint):
                data.qpos[model.jnt_qposadr[joint]] = low + share * (high - low)
                mujoco.mj_kinematics(model, data)
                mujoco.mj_collision(model, data)
                pairs = [p for p in deep_pairs(data, index, CLEARANCE) if owner in p[:2]]
                new = {frozenset(p[:2]) for p in pairs if fixed >= set(p[:2]) - {owner}} - usual
                if new:
                    others = sorted({index.name(o) for pair in new for o in pair if o != owner})
                    name = model.joint(joint).name
                    problem = f"{name} at {share:.0%} of its range meets {', '.join(others)}"
                    failures.append(
                        {
                            "object": index.name(owner),
                            "joint": name,
                            "share": share,
                            "others": others,
                            "problem": problem,
                        }
                    )
                    break
    text = f"{count - len(failures)} of {count} joints have room for their whole range where they stand"
    text = text if count else NO_JOINTS
    return CheckResult("joint_clearance", not failures, text, failures, advisory=True)


def _looks(model: mujoco.MjModel, joint: int) -> np.ndarray:
    """Shares of a joint's range, closely spaced from 0 to 1."""
    low, high = model.jnt_range[joint]
    slides = model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    count = math.ceil((high - low) * (LOOKS_PER_METRE if slides else LOOKS_PER_RADIAN))
    return np.linspace(0.0, 1.0, max(2, count) + 1)
