"""One world of the native engine: its MjData and its row of the view, brought up to date only where something moved."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np

from ig2mj.engine.contact_filter import BitLayers
from ig2mj.engine.controls import LARGEST, clip
from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.model_fields import POSES, ModelFields, given
from ig2mj.engine.native.contacts import FINGER, LINK, NOTHING_MET, ForcePlan, Met, StepContacts, touching_units
from ig2mj.engine.native.lazy_fields import RAW, AgentContacts, LazyPlan, agents_touching, of_owners
from ig2mj.engine.native.model_slot import ModelSlot
from ig2mj.engine.native.nonfinite import why_lost
from ig2mj.engine.native.sleep import restore_sleep, wake_trees
from ig2mj.engine.native.view_rows import Changed, PosePlan, PoseRows
from ig2mj.engine.snapshot import AXIS, Snapshot, closed_circles, make_snapshot
from ig2mj.engine.speed_limits import SpeedLimits
from ig2mj.engine.view import Array
from ig2mj.errors import LostWorldError
from ig2mj.scene.tables import SceneTables

_STATE = tuple(name for name in AXIS if name not in ("eq_data", "tree_asleep"))


@dataclasses.dataclass(frozen=True, eq=False)
class Statics:
    """What all worlds of an engine share.

    Attributes:
      lazy: plan of the fields that are computed when they are read. has_agents: there is one.
      layers: the contact filter. forces: what forces of contacts are of interest.
      own_fields: fields of the model that each world has for itself besides eq_data. substeps: a number for each.
      incremental: a world in which everything sleeps is not stepped.
      See `ig2mj.engine.layout` and `ig2mj.engine.native.view_rows` for the rest.
    """

    tables: SceneTables
    layout: ModelLayout
    poses: PoseRows
    lazy: LazyPlan
    has_agents: bool
    layers: BitLayers
    forces: ForcePlan
    own_fields: tuple[str, ...]
    speed_limits: SpeedLimits
    tolerance: float
    substeps: range
    incremental: bool


class NativeWorld:
    """One world.

    Attributes:
      data: MuJoCo's state. rows: this world's row of each of the engine's working arrays, by field of the view.
      units: [V, V] remembered touching of objects' units.
      agent_contacts: what tells which objects the agents touch.
      pressing: contacts of fingers in the physics steps of the last control step; a new list where it changes.
      fields: fields of the model that this world has for itself, by name; its engine puts them into the model that the
        worlds of a thread share before it does anything with the world. Always there: eq_data and `own_fields`.
      ignored: [H, O] contacts that are dropped. wrong_controls: some control was clipped since the world was loaded.
      lost: why it is neither stepped nor written to until it is loaded, in one line; "" while all is finite. Its rows
        keep the poses of the control step before, and no forces.
    """

    def __init__(self, statics: Statics, slot: ModelSlot, rows: dict[str, np.ndarray], number: int):
        self.statics, self.model, self.rows, self.number = statics, slot.model, rows, number
        self.model_slot, model = slot, slot.model
        self.data = mujoco.MjData(model)
        count = statics.layout.num_object_units
        self.units = np.zeros((count, count), bool)
        nothing = np.zeros((statics.layout.num_units - count, count), bool)
        self._no_contacts = np.zeros((0, 2), np.int32), np.zeros(0)
        self.agent_contacts = AgentContacts(nothing, None, *self._no_contacts)
        self._agent_fresh: np.ndarray | None = None
        self._sleeping_agents = np.zeros(0, int)  # rows of `_cvel`
        self._raw = statics.lazy.raw
        self._copied = self._raw.copied(self.data, rows[RAW])
        self._cvel = self._raw.parts(rows[RAW][None])["cvel"][0]
        self.fields: dict[str, np.ndarray] = {name: slot.own(name) for name in ("eq_data", *statics.own_fields)}
        self.ignored = np.zeros((len(statics.tables.hand_body), statics.tables.num_objects), bool)
        self._plans: dict[bytes, PosePlan] = {}
        self._fresh = np.zeros_like(self.units)  # [U, U] pairs with an awake unit
        self._any_fresh = False
        self._met, self._dist = NOTHING_MET, self._no_contacts[1]  # contacts of the last look; their distances, m
        self._told: tuple[Met | None, bytes, np.ndarray, np.ndarray] = None, b"", self._fresh, self.units
        self._awake_key = self._eq_key = b""
        self._awake = self._awake_before = np.zeros(model.ntree, bool)
        self._none_awake = False
        self._steady_plan = self._plan(self._awake)
        self._has_force = False  # rows["link_force"] is not zero
        self.pressing: list[StepContacts] = []
        self._numbers = self.data.qpos, self.data.qvel
        self._timestep = float(model.opt.timestep)
        self._has_grasps = len(statics.layout.grasp_equality) > 0
        self._from_outside = self.data.qvel, self.data.xfrc_applied, self.data.qfrc_applied
        self._still, self._no_force = (np.zeros_like(array).tobytes() for array in self._from_outside[:2])
        self.wrong_controls, self.lost = False, ""
        self._never_left_alone = model.nmocap > 0 or not statics.incremental

    def step(self, ctrl: np.ndarray | None) -> int:
        """One control step, and the refresh after it. The data stands after `mj_step1` before and after."""
        data = self.data
        if ctrl is not None:
            if not (ctrl.dot(ctrl) <= LARGEST**2):  # true for NaN, too
                clipped, wrong = clip(ctrl[None], data.ctrl[None])
                ctrl, self.wrong_controls = np.asarray(clipped[0]), self.wrong_controls or bool(wrong[0])
            data.ctrl[:] = ctrl
        if self.only_time_passes():
            return Changed.NOTHING
        changed = self.clear_force()
        try:
            steps = self._physics_steps()
        except mujoco.FatalError:  # between bodies that are nowhere there may be more contacts than memory
            self._check_finite()
            raise
        for contacts in steps:
            if contacts is not None:
                changed |= self._note_forces(contacts)
        return changed | self.refresh()

    def _physics_steps(self) -> list[StepContacts | None]:
        """The physics steps of a control step, and the contacts of each whose forces are of interest."""
        model, data, statics = self.model, self.data, self.statics
        mujoco.mj_step2(model, data)
        steps = [self._collect()] if statics.forces.kinds else []
        statics.speed_limits.hold(data.qvel)
        for _ in range(len(statics.substeps) - 1):
            mujoco.mj_step(model, data)
            if steps:
                steps.append(self._collect())
            statics.speed_limits.hold(data.qvel)
        mujoco.mj_step1(model, data)
        return steps

    def _collect(self) -> StepContacts | None:
        forces, data = self.statics.forces, self.data
        self._met = met = forces.met(data, self._met)
        return forces.collect(data, met)

    def only_time_passes(self) -> bool:
        """Lets time pass by one control step where that is all that happens; false where the world must be stepped.

        So it is where all trees sleep and nothing reaches in from outside that could wake one (MuJoCo, too, looks at
        the bytes of just these arrays). MuJoCo would still go through every geom.
        """
        data = self.data
        if not self._none_awake or self._has_force or self.pressing or data.ntree_awake or self._never_left_alone:
            return False
        velocity, force, joints = self._from_outside  # not in a loop: all this takes less than a microsecond
        if velocity.tobytes() != self._still or joints.tobytes() != self._still or force.tobytes() != self._no_force:
            return False
        if self._has_grasps and self._active_grasps().tobytes() != self._eq_key:
            return False
        time, timestep = data.time, self._timestep
        for _ in self.statics.substeps:
            time += timestep
        data.time = time
        return True

    def refresh(self, everything: bool = False) -> int:
        """Brings the rows up to date with `data`, whose position stage is.

        Args:
          everything: also what sleeps, and touching from this instant's contacts alone.
        """
        if self._none_awake and not self.data.ntree_awake and not everything:
            return self._refresh_held()
        changed = self._note_awake()
        if everything:
            plan = self._plan(None)
        else:
            plan = self._plan(self._awake | self._awake_before) if changed else self._steady_plan
            self._check_finite()
        changed |= self.statics.poses.refresh(plan, self.data, self.rows) | self._refresh_held()
        self._met = self.statics.forces.met(self.data, self._met)
        self._dist = self.data.contact.dist.copy() if self._met.key else self._no_contacts[1]
        if plan.agents:
            for into, of in self._copied:
                into[:] = of
        if self._any_fresh or changed & Changed.AWAKE or everything:
            changed |= self._refresh_touching(everything)
        if self.statics.has_agents:
            changed |= self._note_agent_contacts()
        return changed

    def _note_agent_contacts(self) -> int:
        geom, dist = self._met.geom, self._dist
        if self._agent_fresh is None:  # then what they touch hangs on this instant's contacts alone
            self.agent_contacts = AgentContacts(self.agent_contacts.remembered, None, geom, dist)
        else:
            self.agent_contacts = AgentContacts(self.agents_touch(), self._agent_fresh, geom, dist)
        if len(self._sleeping_agents):
            self._cvel[self._sleeping_agents] = 0.0  # MuJoCo leaves old velocities where a body sleeps
        return Changed.AGENT

    def agents_touch(self) -> np.ndarray:
        """Touching of agents' units with objects' [agents' units, V]."""
        return agents_touching(self.statics.lazy, self.agent_contacts)

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
        saved = self.save()
        wake_trees(model, data, np.arange(model.ntree))
        mujoco.mj_step1(model, data)
        self.refresh(everything=True)
        shown = self.save()
        return self.load(
            dataclasses.replace(
                saved,
                scene=dataclasses.replace(saved.scene, touching=shown.scene.touching),
                agents=dataclasses.replace(saved.agents, touching=shown.agents.touching),
            )
        )

    def save(self) -> Snapshot:
        """The world as a snapshot in arrays of its own."""
        data = self.data
        fields = {name: np.array(getattr(data, name)) for name in (*_STATE, "tree_asleep")}
        fields["eq_active"] = fields["eq_active"].astype(bool)
        return make_snapshot(
            fields | {"eq_data": np.array(self.fields["eq_data"])},
            self.statics.layout.scene_sizes,
            np.asarray(data.time),
            self.units.copy(),
            self.agents_touch().copy(),
            self.ignored.copy(),
            ModelFields(**{name: self.fields[name].copy() for name in self.statics.own_fields}),
        )

    def load(self, snapshot: Snapshot) -> int:
        """Takes a snapshot without the world axis, and refreshes everything."""
        self.wrong_controls, self.lost = False, ""
        model, data = self.model, self.data
        self.set_fields(eq_data=np.asarray(snapshot.eq_data), **given(snapshot.model_fields))
        mujoco.mj_resetData(model, data)  # where bodies without joints are is computed here alone
        self.ignore(np.asarray(snapshot.agents.ignored_contacts))
        state = {name: snapshot.whole(name) for name in _STATE}
        self._set_state(state, float(snapshot.time))
        wake_trees(model, data, np.arange(model.ntree))
        mujoco.mj_step1(model, data)  # kinematics of everything, while everything is awake
        self._set_state(state, float(snapshot.time))
        restore_sleep(model, data, closed_circles(snapshot.tree_asleep))
        mujoco.mj_step1(model, data)
        self.units = np.array(snapshot.scene.touching, bool)
        known = np.array(snapshot.agents.touching, bool)
        self.agent_contacts = AgentContacts(known, np.zeros_like(known), *self._no_contacts)
        changed = self.clear_force() | self.refresh(everything=True)
        return Changed.ALL if POSES[0] in self.fields else changed  # also of what never moves otherwise

    def _set_state(self, state: Mapping[str, Array], time: float) -> None:
        for name, array in state.items():
            getattr(self.data, name)[:] = array
        self.data.qacc[:] = state["qacc_warmstart"]
        self.data.time = time

    def set_fields(self, **fields: np.ndarray | None) -> None:
        """Fields of the model that this world has for itself from now on; None: the model's own again."""
        kept = {name: array for name, array in (self.fields | fields).items() if array is not None}
        self.fields = {name: np.array(array, self.model_slot.own(name).dtype) for name, array in kept.items()}
        self.model_slot.put(self.fields)

    def ignore(self, ignored: np.ndarray) -> None:
        """Drops the contacts of hands with objects [H, O] from now on."""
        if np.array_equal(ignored, self.ignored):
            return
        self.ignored = np.array(ignored, bool)
        contype, conaffinity = self.statics.layers.masks(self.ignored) or (None, None)
        self.set_fields(geom_contype=contype, geom_conaffinity=conaffinity)

    def clear_force(self) -> int:
        """Forgets the contact forces of the last control step."""
        changed = Changed.NOTHING
        if self._has_force:
            self.rows["link_force"][:] = 0.0
            self._has_force = False
            changed |= Changed.FORCE
        if self.pressing:
            self.pressing = []
            changed |= Changed.FINGERS
        return changed

    def _note_forces(self, contacts: StepContacts) -> int:
        """Adds forces of a physics step of this control step: links' at once, since states read them in every step;
        fingers' contacts are kept until they are read."""
        changed, forces = Changed.NOTHING, self.statics.forces
        if contacts.met.kinds & LINK and forces.add_links(contacts, self.rows["link_force"]):
            self._has_force = True
            changed |= Changed.FORCE
        if contacts.met.kinds & FINGER:
            self.pressing = [*self.pressing, contacts]  # views may hold the old list
            changed |= Changed.FINGERS
        return changed

    def _check_finite(self) -> None:
        qpos, qvel = self._numbers
        if qpos.dot(qpos) < mujoco.mjMAXVAL and qvel.dot(qvel) < mujoco.mjMAXVAL:
            return  # false for NaN, too; what is larger is looked at closely
        self.lost = why_lost(self.number, self.model, self.data)
        if self.lost:
            self.clear_force()
            self._none_awake = False  # no time passes
            raise LostWorldError(self.lost)

    def _plan(self, trees: np.ndarray | None) -> PosePlan:
        """What moves with the given trees [T]; None: everything there is."""
        key = b"all" if trees is None else trees.tobytes()
        plan = self._plans.get(key)
        if plan is None:
            if len(self._plans) > 256:  # one per set of awake trees; sets repeat, but not for ever
                self._plans.clear()
            plan = self._plans[key] = self.statics.poses.plan(trees)
        return plan

    def _note_awake(self) -> int:
        """Takes over which trees are awake, and everything that hangs on it alone."""
        data, layout = self.data, self.statics.layout
        key = data.tree_awake.tobytes()
        if key == self._awake_key:
            return Changed.NOTHING
        self._awake_key = key
        # What just fell asleep still moved during the control step that is over.
        self._awake_before, self._awake = self._awake, data.tree_awake != 0
        self._none_awake = not self._awake.any()
        self._steady_plan = self._plan(self._awake)
        every_unit = np.concatenate([self._awake, [False]])[layout.unit_tree]
        unit_awake, agent_awake = np.split(every_unit, [len(self.units)])
        if self.statics.has_agents:
            self._agent_fresh = None if agent_awake.all() else agent_awake[:, None] | unit_awake
            tree = np.asarray(self.model.body_treeid)
            asleep = (tree >= 0) & ~self._awake[tree]
            self._sleeping_agents = np.flatnonzero(asleep[self._raw.starts["cvel"] :][: len(self._cvel)])
        self._fresh = unit_awake[:, None] | unit_awake
        self._any_fresh = bool(unit_awake.any())
        asleep = ~self._awake[self.model.dof_treeid]
        for array in (data.qacc, data.qacc_smooth, data.qacc_warmstart):
            array[asleep] = 0.0  # MuJoCo leaves old values there; a loaded world must start a wake from the same ones
        self.rows["awake"][:] = (layout.object_trees & self._awake).any(1)
        return Changed.AWAKE

    def _refresh_held(self) -> int:
        if not self._has_grasps:
            return Changed.NOTHING
        layout, active = self.statics.layout, self._active_grasps()
        key = active.tobytes()
        if key == self._eq_key:
            return Changed.NOTHING
        self._eq_key = key
        held = self.rows["held"]
        held[:] = False
        held[layout.grasp_hand[active], layout.grasp_object[active]] = True
        return Changed.HELD

    def _active_grasps(self) -> np.ndarray:
        return self.data.eq_active[self.statics.layout.grasp_equality].astype(bool)

    def _refresh_touching(self, everything: bool) -> int:
        lazy, near = self.statics.lazy, self._dist <= self.statics.tolerance
        told = near.tobytes()
        met, before, fresh, units = self._told
        if told == before and self._met is met and self._fresh is fresh and self.units is units and not everything:
            return Changed.NOTHING  # the same contacts said so before
        units = touching_units(lazy.object_unit[self._met.geom], near, self.units, self._fresh)
        self._told = self._met, told, self._fresh, units
        if units is self.units and not everything:
            return Changed.NOTHING
        self.units = units
        touching = self.rows["touching"]
        touching[:] = of_owners(of_owners(units, lazy.unit_starts, 0), lazy.unit_starts, 1)
        np.fill_diagonal(touching, False)
        return Changed.TOUCHING
