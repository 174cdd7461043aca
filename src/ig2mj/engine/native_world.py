"""One world of the native engine: its MjData and its row of the view, brought up to date only where something moved."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.engine.boxes import BoxPlan, BoxTable, plan_boxes, world_boxes
from ig2mj.engine.contacts import add_link_forces, touching_units
from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.sleep import restore_sleep, wake_trees
from ig2mj.errors import EngineError
from ig2mj.scene.tables import SceneTables


class Changed:
    """Groups of view fields that a refresh wrote: bits of an int (plain ones; an IntFlag costs a microsecond a use)."""

    NOTHING = 0
    BODIES = 1
    OBJECTS = 2
    LINKS = 4
    JOINTS = 8
    TOUCHING = 16
    FORCE = 32
    AWAKE = 64
    AGENT = 128
    GRASPED = 256
    ALL = 511


FIELDS: dict[str, int] = {
    "object_pos": Changed.OBJECTS,
    "object_quat": Changed.OBJECTS,
    "object_com": Changed.OBJECTS,
    "aabb_low": Changed.OBJECTS,
    "aabb_high": Changed.OBJECTS,
    "body_pos": Changed.BODIES,
    "body_quat": Changed.BODIES,
    "link_pos": Changed.LINKS,
    "link_quat": Changed.LINKS,
    "joint_pos": Changed.JOINTS,
    "touching": Changed.TOUCHING,
    "link_force": Changed.FORCE,
    "awake": Changed.AWAKE,
    "agent_pos": Changed.AGENT,
    "eye_pos": Changed.AGENT,
    "eye_quat": Changed.AGENT,
    "finger_pos": Changed.AGENT,
    "grasped": Changed.GRASPED,
}
"""The view's fields, and the group that each is written with."""

_STATE = ("qpos", "qvel", "act", "ctrl", "qacc_warmstart", "eq_active", "mocap_pos", "mocap_quat")


@dataclasses.dataclass(frozen=True, eq=False)
class Statics:
    """What all worlds of an engine share.

    Attributes:
      unit_starts: [O] first unit of each object. force_links: some annotated link is a geom.
      See `ig2mj.engine.layout` and `ig2mj.engine.boxes` for the rest.
    """

    tables: SceneTables
    layout: ModelLayout
    boxes: BoxTable
    body_tree: np.ndarray
    contact_unit: np.ndarray
    unit_starts: np.ndarray
    force_links: bool
    pyramidal: bool
    tolerance: float
    substeps: int


@dataclasses.dataclass(frozen=True, eq=False)
class _Plan:
    """Which rows of the view move with a set of trees."""

    bodies: np.ndarray
    objects: np.ndarray
    roots: np.ndarray
    links: np.ndarray
    link_bodies: np.ndarray
    boxes: BoxPlan
    agents: bool
    joints: bool


class World:
    """One world.

    Attributes:
      data: MuJoCo's state. rows: this world's row of each of the engine's working arrays, by field of the view.
      units: [U, U] remembered touching of units.
      eq_data: [E, 11] this world's equality parameters; its engine puts them into the model before it steps.
    """

    def __init__(self, statics: Statics, model: mujoco.MjModel, rows: dict[str, np.ndarray], number: int):
        self.statics, self.model, self.rows, self.number = statics, model, rows, number
        self.data = mujoco.MjData(model)
        self.units = np.zeros((statics.layout.num_units, statics.layout.num_units), bool)
        self.eq_data = np.array(model.eq_data)
        self._plans: dict[bytes, _Plan] = {}
        self._fresh_key, self._fresh = b"", self.units
        self._awake_key = b""
        self._eq_key = b""
        self._moving = np.ones(model.ntree, bool)
        self._has_force = False

    def step(self, ctrl: np.ndarray | None) -> int:
        """One control step, and the refresh after it. The data stands after `mj_step1` before and after."""
        model, data, statics = self.model, self.data, self.statics
        if ctrl is not None:
            data.ctrl[:] = ctrl
        changed = self.clear_force()
        mujoco.mj_step2(model, data)
        if statics.force_links and data.ntree_awake:
            found = self._collect_force()
            for _ in range(statics.substeps - 1):
                mujoco.mj_step(model, data)
                found |= self._collect_force()
            if found:
                self._has_force = True
                changed |= Changed.FORCE
        elif statics.substeps > 1:
            mujoco.mj_step(model, data, nstep=statics.substeps - 1)
        mujoco.mj_step1(model, data)
        return changed | self.refresh()

    def refresh(self, everything: bool = False) -> int:
        """Brings the rows up to date with `data`, whose position stage is.

        Args:
          everything: also what sleeps, and touching from this instant's contacts alone.
        """
        data = self.data
        if everything:
            plan = self._plan(None)
            self._moving[:] = True
        elif not data.ntree_awake and not self._moving.any():
            return self._refresh_grasped()
        else:
            awake = data.tree_awake != 0
            plan = self._plan(awake | self._moving)  # what just fell asleep moved during the step, too
            self._moving = awake
            self._check_finite()
        changed = self._refresh_poses(plan) | self._refresh_awake() | self._refresh_grasped()
        return changed | self._refresh_touching(everything)

    def start(self) -> int:
        """The scene's initial state: its first keyframe, else the zero pose."""
        model, data = self.model, self.data
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        asleep = data.tree_asleep.copy()
        if (asleep < 0).all():
            mujoco.mj_step1(model, data)
            return self.refresh(everything=True)
        # Some trees start asleep (`sleep="init"`): let them show their contacts once.
        fields = self.save()
        wake_trees(model, data, np.arange(model.ntree))
        mujoco.mj_step1(model, data)
        self.refresh(everything=True)
        return self.load({**fields, "tree_asleep": asleep, "touching": self.units})

    def save(self) -> dict[str, np.ndarray]:
        """Copies of the fields of a snapshot (see `ig2mj.engine.base.Snapshot`)."""
        data = self.data
        fields = {name: np.array(getattr(data, name)) for name in (*_STATE, "tree_asleep")}
        fields["eq_active"] = fields["eq_active"].astype(bool)
        return fields | {"eq_data": self.eq_data.copy(), "time": np.asarray(data.time), "touching": self.units.copy()}

    def load(self, fields: dict[str, np.ndarray]) -> int:
        """Takes the fields of a snapshot, and refreshes everything."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        self.eq_data = np.array(fields["eq_data"], np.float64)
        model.eq_data[:] = self.eq_data
        self._set_state(fields)
        wake_trees(model, data, np.arange(model.ntree))
        mujoco.mj_step1(model, data)  # kinematics of everything, while everything is awake
        self._set_state(fields)
        restore_sleep(model, data, fields["tree_asleep"])
        mujoco.mj_step1(model, data)
        self.units = np.array(fields["touching"], bool)
        changed = self.clear_force() | self.refresh(everything=True)
        self._moving = data.tree_awake != 0
        return changed

    def _set_state(self, fields: dict[str, np.ndarray]) -> None:
        for name in _STATE:
            getattr(self.data, name)[:] = fields[name]
        self.data.qacc[:] = fields["qacc_warmstart"]
        self.data.time = float(fields["time"])

    def clear_force(self) -> int:
        """Forgets the contact forces of the last control step."""
        if not self._has_force:
            return Changed.NOTHING
        self.rows["link_force"][:] = 0.0
        self._has_force = False
        return Changed.FORCE

    def _collect_force(self) -> bool:
        statics = self.statics
        return add_link_forces(
            self.data, statics.layout, statics.tables.geom_object, statics.pyramidal, self.rows["link_force"]
        )

    def _check_finite(self) -> None:
        data = self.data
        if abs(float(data.qpos.sum())) < mujoco.mjMAXVAL and abs(float(data.qvel.sum())) < mujoco.mjMAXVAL:
            return  # false for NaN, too
        model = self.model
        wrong = ~(np.abs(data.qvel) < mujoco.mjMAXVAL)
        bodies = set(model.dof_bodyid[wrong])
        coordinates = np.flatnonzero(~(np.abs(data.qpos) < mujoco.mjMAXVAL))
        bodies |= set(model.jnt_bodyid[np.searchsorted(model.jnt_qposadr, coordinates, side="right") - 1])
        if not bodies:
            return
        names = [f"'{model.body(int(b)).name}'" for b in sorted(bodies)]
        listed = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        raise EngineError(
            f"world {self.number}: position or velocity is not finite at t = {data.time:.3f} s of {listed} "
            "(reset the world; a smaller timestep or weaker controls may mend it)"
        )

    def _plan(self, trees: np.ndarray | None) -> _Plan:
        """What moves with the given trees [T]; None: everything there is."""
        key = b"all" if trees is None else trees.tobytes()
        plan = self._plans.get(key)
        if plan is None:
            if len(self._plans) > 256:  # one per set of awake trees; sets repeat, but not for ever
                self._plans.clear()
            plan = self._plans[key] = self._make_plan(trees)
        return plan

    def _make_plan(self, trees: np.ndarray | None) -> _Plan:
        statics, tables = self.statics, self.statics.tables
        tree = statics.body_tree
        moves = np.ones(len(tree), bool) if trees is None else (tree >= 0) & trees[tree]
        bodies = np.flatnonzero(moves)
        objects = np.unique(tables.body_object[bodies])
        objects = objects[objects >= 0]
        links = np.flatnonzero(moves[tables.link_body])
        agent_bodies = np.concatenate([tables.agent_body, tables.finger_body])
        return _Plan(
            bodies=bodies,
            objects=objects,
            roots=tables.object_root[objects],
            links=links,
            link_bodies=tables.link_body[links],
            boxes=plan_boxes(statics.boxes, objects),
            agents=bool(len(agent_bodies)) and bool(trees is None or moves[agent_bodies].any()),
            joints=bool(len(tables.openable_object)) and bool(np.isin(tables.openable_object, objects).any()),
        )

    def _refresh_poses(self, plan: _Plan) -> int:
        data, rows, tables = self.data, self.rows, self.statics.tables
        changed = Changed.NOTHING
        xpos, xquat, xmat = data.xpos, data.xquat, data.xmat
        if len(plan.bodies):
            rows["body_pos"][plan.bodies] = xpos[plan.bodies]
            rows["body_quat"][plan.bodies] = xquat[plan.bodies]
            changed |= Changed.BODIES
        if len(plan.objects):
            rows["object_pos"][plan.objects] = xpos[plan.roots]
            rows["object_quat"][plan.objects] = xquat[plan.roots]
            rows["object_com"][plan.objects] = data.xipos[plan.roots]
            rows["aabb_low"][plan.objects], rows["aabb_high"][plan.objects] = world_boxes(
                self.statics.boxes, plan.boxes, xpos, xmat
            )
            changed |= Changed.OBJECTS
        if plan.joints:
            rows["joint_pos"][:] = data.qpos[tables.openable_qposadr]
            changed |= Changed.JOINTS
        if len(plan.links):
            turn = xmat[plan.link_bodies].reshape(-1, 3, 3)
            offset = (turn @ tables.link_pos[plan.links][..., None])[..., 0]
            rows["link_pos"][plan.links] = xpos[plan.link_bodies] + offset
            rows["link_quat"][plan.links] = _multiply(xquat[plan.link_bodies], tables.link_quat[plan.links])
            changed |= Changed.LINKS
        if plan.agents:
            rows["agent_pos"][:] = xpos[tables.agent_body]
            rows["finger_pos"][:] = xpos[tables.finger_body]
            quat = np.zeros(4)
            for agent, camera in enumerate(tables.agent_camera):
                if camera >= 0:
                    rows["eye_pos"][agent] = data.cam_xpos[camera]
                    mujoco.mju_mat2Quat(quat, data.cam_xmat[camera])
                    rows["eye_quat"][agent] = quat
                else:
                    rows["eye_pos"][agent] = xpos[tables.agent_body[agent]]
                    rows["eye_quat"][agent] = xquat[tables.agent_body[agent]]
            changed |= Changed.AGENT
        return changed

    def _refresh_awake(self) -> int:
        awake = self.data.tree_awake != 0
        key = awake.tobytes()
        if key == self._awake_key:
            return Changed.NOTHING
        self._awake_key = key
        asleep = ~awake[self.model.dof_treeid]
        for array in (self.data.qacc, self.data.qacc_smooth, self.data.qacc_warmstart):
            array[asleep] = 0.0  # MuJoCo leaves old values there; a loaded world must start a wake from the same ones
        self.rows["awake"][:] = (self.statics.layout.object_trees & awake).any(1)
        return Changed.AWAKE

    def _refresh_grasped(self) -> int:
        layout = self.statics.layout
        if not len(layout.grasp_equality):
            return Changed.NOTHING
        active = self.data.eq_active[layout.grasp_equality].astype(bool)
        key = active.tobytes()
        if key == self._eq_key:
            return Changed.NOTHING
        self._eq_key = key
        grasped = self.rows["grasped"]
        grasped[:] = False
        grasped[layout.grasp_agent[active], layout.grasp_object[active]] = True
        return Changed.GRASPED

    def _refresh_touching(self, everything: bool) -> int:
        statics, data = self.statics, self.data
        awake = data.tree_awake != 0
        key = awake.tobytes()
        if key != self._fresh_key:
            unit_awake = np.concatenate([awake, [False]])[statics.layout.unit_tree]
            self._fresh_key, self._fresh = key, unit_awake[:, None] | unit_awake
        units = touching_units(data, statics.contact_unit, statics.tolerance, self.units, self._fresh)
        if units is self.units and not everything:
            return Changed.NOTHING
        self.units = units
        starts = statics.unit_starts
        touching = self.rows["touching"]
        if len(starts) == len(units):
            touching[:] = units
        else:
            touching[:] = np.logical_or.reduceat(np.logical_or.reduceat(units, starts, 0), starts, 1)
        np.fill_diagonal(touching, False)
        return Changed.TOUCHING


def _multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Products of quaternions [n, 4], w-x-y-z."""
    w, v = p[:, :1], p[:, 1:]
    s, u = q[:, :1], q[:, 1:]
    real = w * s - (v * u).sum(1, keepdims=True)
    return np.concatenate([real, w * u + s * v + np.cross(v, u)], 1)
