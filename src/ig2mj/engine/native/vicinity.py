"""`Vicinity`: keeps out of C MuJoCo's broad phase what nothing that is awake can reach.

In every physics step MuJoCo goes through every geom of every body to find pairs of bodies that may touch, asleep or
not: with one robot awake in a home of 60 objects that is half of the time. Bodies are left out here by a mask
(`body_contype`, `body_conaffinity`) only while they cannot have a contact, so that the contacts, and with them
everything, stay bitwise the same:

- around every body that is awake lies a sphere with all its geoms in whatever pose, grown by `SPHERE_MARGIN`. What a
  grown sphere's box meets stays in. If that may be woken by a touch, its own neighbours stay in, too, and so on.
- after each physics step, before the next collision, the speeds tell how far any body can have moved at most
  (positions are integrated from just these speeds). When that comes to `SPHERE_MARGIN`, neighbours are looked for anew.

A mask is only used where it saves more than it costs (`WORTHWHILE`, `PAYS`).

Whoever changes a world by another way than a step must tell (`forget`).

Axes: B bodies, G geoms, T trees, V degrees of freedom.
"""

from __future__ import annotations

import dataclasses
import math

import mujoco
import numpy as np

SPHERE_MARGIN = 0.25
"""Metres by which spheres are grown. Farther: more bodies stay in; nearer: they are looked for more often."""

ROUNDING = 1e-6
"""Metres of the reach that are left to rounding."""

WORTHWHILE = 100
"""Geoms that a mask must keep out to be worth its time: each saves 0.04 us of a physics step, looking costs 300."""

PAYS = 2500
"""Geoms kept out, times control steps, that a mask must have come to to be followed by another one at once: what it has
saved is what the next look costs."""

LASTING = 6
"""Control steps for which everything stays in after something was changed by another way than a step."""

PATIENCE = 30
"""Control steps until it is tried again, where it was not worth it or fewer trees are awake than when last tried."""

NEGLIGIBLE_TRAVEL = 1e-4
"""Metres of a physics step that need not be known better."""

_NEVER = 1e30
"""Weight of the speed of what must not move."""


@dataclasses.dataclass(frozen=True, eq=False)
class VicinityTable:
    """What never changes; shared by the worlds of an engine.

    Attributes:
      usable: the model has nothing that this does not understand (mocap bodies, tendons, flexes, geom pairs).
      contype, conaffinity: [B] of the model, everything in. always: [B] bodies that stay in.
      bodies: [b] those with geoms that collide. tree: [b] theirs, -1 static. geoms: [b] how many.
      centre, half: [b, 3, 1] box of their geoms and margins in the body's frame. radius: [b, 1] of the sphere about it.
      dof_tree: [V]. tree_dof: [T] first degree of freedom of each tree.
      driven: [T] trees with actuators. equality, linked: [e], [e, 2] constraints that join two trees, and these trees.
      levers: what turns with what.
    """

    usable: bool
    timestep: float
    contype: np.ndarray
    conaffinity: np.ndarray
    bodies: np.ndarray
    tree: np.ndarray
    centre: np.ndarray
    half: np.ndarray
    radius: np.ndarray
    geoms: np.ndarray
    always: np.ndarray
    dof_tree: np.ndarray
    tree_dof: np.ndarray
    driven: np.ndarray
    equality: np.ndarray
    linked: np.ndarray
    levers: Levers

    @classmethod
    def build(cls, model: mujoco.MjModel, equality_tree: np.ndarray) -> VicinityTable:
        """The table of an engine's model; `equality_tree` is the layout's."""
        geoms = np.flatnonzero((model.geom_contype | model.geom_conaffinity) != 0)
        owner = np.asarray(model.geom_bodyid)[geoms]
        bodies, group, count = np.unique(owner, return_inverse=True, return_counts=True)
        grow = np.asarray(model.geom_margin + model.geom_gap)[geoms, None]
        turn = np.array([_matrix(q) for q in model.geom_quat[geoms]]).reshape(-1, 3, 3)
        box = np.asarray(model.geom_aabb)[geoms]
        centre = np.asarray(model.geom_pos)[geoms] + (turn @ box[:, :3, None])[..., 0]
        reach = (np.abs(turn) @ box[:, 3:, None])[..., 0] + grow
        low, high = np.full((len(bodies), 3), np.inf), np.full((len(bodies), 3), -np.inf)
        np.minimum.at(low, group, centre - reach)
        np.maximum.at(high, group, centre + reach)
        rbound = np.asarray(model.geom_rbound)[geoms]
        radius = np.zeros(len(bodies))
        np.maximum.at(radius, group, np.linalg.norm(model.geom_pos[geoms], axis=1) + rbound + grow[:, 0])
        always = np.zeros(model.nbody, bool)
        always[0] = True
        always[owner[rbound <= 0]] = True  # planes have no end
        driven = np.zeros(model.ntree, bool)
        for actuator in range(model.nu):
            driven[_trees_of_actuator(model, actuator)] = True
        between = (equality_tree >= 0).all(1)
        strange = model.nmocap or model.ntendon or model.nflex or model.npair
        return cls(
            usable=bool(
                not strange
                and count.sum() >= WORTHWHILE
                and model.opt.integrator != int(mujoco.mjtIntegrator.mjINT_RK4)
            ),
            timestep=float(model.opt.timestep),
            contype=np.array(model.body_contype),
            conaffinity=np.array(model.body_conaffinity),
            bodies=bodies,
            tree=np.asarray(model.body_treeid)[bodies],
            centre=((low + high) / 2)[..., None],
            half=((high - low) / 2)[..., None],
            radius=radius[:, None],
            geoms=count,
            always=always,
            dof_tree=np.array(model.dof_treeid),
            tree_dof=np.array(model.tree_dofadr),
            driven=driven,
            equality=np.flatnonzero(between),
            linked=equality_tree[between],
            levers=Levers.build(model),
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Levers:
    """Which points a joint moves, for all joints: rows of (joint, point), sorted by joint.

    Attributes:
      joint, point: [r]; points are the frames of bodies, then the anchors of joints. slack: [r] metres by which the two
      may draw apart. starts: [j] first row of each joint. dof_joint: [V]. straight: [V] the freedom moves without
      turning.
    """

    joint: np.ndarray
    point: np.ndarray
    slack: np.ndarray
    starts: np.ndarray
    dof_joint: np.ndarray
    straight: np.ndarray

    @classmethod
    def build(cls, model: mujoco.MjModel) -> Levers:
        own_body, parent = np.asarray(model.jnt_bodyid), np.asarray(model.body_parentid)
        below = np.eye(model.nbody, dtype=bool)  # [a, b]: b is a, or hangs on it
        for body in range(1, model.nbody):  # parents come first
            below[:, body] |= below[:, parent[body]]
        joint, point, slack = [], [], []
        for k, own in enumerate(own_body.tolist()):
            for body in np.flatnonzero(below[own]).tolist():
                fixed = _keeps_distance(model, own, body, int(model.body_jntnum[body]))
                joint, point, slack = [*joint, k], [*point, body], [*slack, 0.0 if fixed else 2 * SPHERE_MARGIN]
            for other in np.flatnonzero(below[own, own_body]).tolist():
                if other != k:
                    body = int(own_body[other])
                    fixed = _keeps_distance(model, own, body, other - int(model.body_jntadr[body]))
                    joint, point = [*joint, k], [*point, model.nbody + other]
                    slack = [*slack, 0.0 if fixed else 2 * SPHERE_MARGIN]
        dof_joint = np.array(model.dof_jntid)
        kind, first = np.asarray(model.jnt_type)[dof_joint], np.asarray(model.jnt_dofadr)[dof_joint]
        free = (kind == int(mujoco.mjtJoint.mjJNT_FREE)) & (np.arange(model.nv) < first + 3)
        return cls(
            joint=np.array(joint, int),
            point=np.array(point, int),
            slack=np.array(slack),
            starts=np.searchsorted(joint, np.arange(model.njnt)),
            dof_joint=dof_joint,
            straight=free | (kind == int(mujoco.mjtJoint.mjJNT_SLIDE)),
        )

    def weights(self, data: mujoco.MjData) -> np.ndarray:
        """Metres [V] that any point moves at most, per radian or metre of each degree of freedom."""
        anchor = data.xanchor
        away = np.concatenate([data.xpos, anchor])[self.point] - anchor[self.joint]
        turning = np.maximum.reduceat(np.sqrt(np.square(away).sum(1)) + self.slack, self.starts)
        return np.where(self.straight, 1.0, turning[self.dof_joint])


class Masks:
    """The masks that stand in a model, which the worlds of a thread share."""

    def __init__(self, table: VicinityTable, model: mujoco.MjModel):
        """Everything is in."""
        self._table, self._contype, self._conaffinity = table, model.body_contype, model.body_conaffinity
        self._stands = table.contype

    def put(self, contype: np.ndarray, conaffinity: np.ndarray) -> None:
        """Writes masks [B] into the model, where they do not stand already."""
        if contype is not self._stands:
            self._contype[:], self._conaffinity[:], self._stands = contype, conaffinity, contype

    def open(self) -> None:
        """Everything is in."""
        self.put(self._table.contype, self._table.conaffinity)


class Vicinity:
    """Which bodies of one world stay in the broad phase, and until when.

    Attributes:
      contype, conaffinity: [B] the masks in force, for the model; the table's own where everything stays in.
    """

    def __init__(self, table: VicinityTable, model: mujoco.MjModel, data: mujoco.MjData):
        """Everything stays in until the first step."""
        self.table, self._model, self._data = table, model, data
        self._qvel, self._tree_awake, self._eq_active = data.qvel, data.tree_awake, data.eq_active
        self._applied = data.qfrc_applied, data.xfrc_applied
        self._no_force = tuple(np.zeros_like(array).tobytes() for array in self._applied)
        self._weights, self._speeds = np.zeros(model.nv), np.zeros(model.nv)
        self._bits, self._still = self._qvel.view(np.int64), np.zeros(model.nv, np.int64)
        self._left = 0.0  # metres that a body may still move
        self._loose = 0.0  # metres per unit of the speeds' norm
        self._looked_at = b"", b""  # trees awake, equalities active
        self._wait = self._out = 0  # control steps until the next look; geoms kept out
        self._let_in()

    @property
    def open(self) -> bool:
        """Whether everything stays in."""
        return self.contype is self.table.contype

    def forget(self) -> None:
        """Something changed by another way than a step: everything stays in until that is some steps ago."""
        self._wait = LASTING
        self._let_in()

    def begin(self) -> None:
        """Before a control step; the data stands after `mj_step1`."""
        if not self.table.usable:
            return
        forces, none = self._applied, self._no_force
        if forces[0].tobytes() != none[0] or forces[1].tobytes() != none[1]:
            return self.forget()  # what sleeps may wake anywhere
        if not self.open and np.count_nonzero(self._bits & self._still):  # half the time of any()
            return self.forget()  # velocities from outside wake, too, even a minus zero
        now = self._tree_awake.tobytes(), self._eq_active.tobytes()
        self._wait -= 1
        if self._wait < 0 if self.open else now != self._looked_at and (self._wait < 0 or not self._reckons_with(now)):
            self._look(now)

    def moved(self) -> None:
        """After positions were integrated, before the next collision."""
        if self.open:
            return
        # First a bound that is quick to compute and loose; it is all that an agent at rest needs.
        travel = math.sqrt(self._qvel.dot(self._qvel)) * self._loose
        self._left -= travel if travel < NEGLIGIBLE_TRAVEL else self._travel()
        if not self._left >= 0.0:
            self._look((self._tree_awake.tobytes(), self._eq_active.tobytes()))

    def _travel(self) -> float:
        """Metres, at least what any body moved in the last physics step; infinite where that is unknown. A body moves
        with the joints of its own tree only."""
        np.abs(self._qvel, out=self._speeds)
        self._speeds *= self._weights
        return float(np.add.reduceat(self._speeds, self.table.tree_dof).max()) * self.table.timestep

    def _reckons_with(self, now: tuple[bytes, bytes]) -> bool:
        """Whether the trees that are awake were reckoned with when neighbours were looked for."""
        awake = np.frombuffer(now[0], self._tree_awake.dtype) != 0
        return now[1] == self._looked_at[1] and not (awake & ~self._trees).any()

    def _let_in(self) -> None:
        self.contype, self.conaffinity = self.table.contype, self.table.conaffinity

    def _look(self, now: tuple[bytes, bytes]) -> None:
        """Finds what stays in. Positions may be those before the last integration: that step counts as moved."""
        table, lasted = self.table, PATIENCE - self._wait
        self._looked_at, self._wait = now, PATIENCE
        if not self.open and lasted * self._out < PAYS:
            self._wait = 4 * PATIENCE  # too much moves, or too fast
            return self._let_in()
        kept, self._trees = self._neighbours()
        self._out = int(table.geoms @ ~kept[table.bodies])
        if self._out < WORTHWHILE:
            return self._let_in()
        sure = self._trees[table.dof_tree]
        self._weights = np.where(sure, table.levers.weights(self._data), _NEVER)
        self._loose = max(1.0, float(np.linalg.norm(self._weights[sure]))) * table.timestep
        self._still = np.where(sure, 0, -1)
        self._left = SPHERE_MARGIN - ROUNDING - self._travel()
        if not self._left >= 0.0:
            return self._let_in()
        self.contype, self.conaffinity = table.contype * kept, table.conaffinity * kept

    def _neighbours(self) -> tuple[np.ndarray, np.ndarray]:
        """Bodies [B] that stay in, and trees [T] that may move."""
        table, data = self.table, self._data
        pos, turn = data.xpos[table.bodies], data.xmat[table.bodies].reshape(-1, 3, 3)
        centre = pos + (turn @ table.centre)[..., 0]
        half = (np.abs(turn) @ table.half)[..., 0]
        low, high, size = centre - half, centre + half, table.radius + SPHERE_MARGIN
        kept = table.always.copy()
        new = (self._tree_awake != 0) | table.driven
        trees = np.zeros_like(new)
        while new.any():
            trees |= new
            here = np.append(new, False)[table.tree]
            near, far = (pos[here] - size[here])[:, None], (pos[here] + size[here])[:, None]
            meets = ((low <= far) & (high >= near)).all(-1).any(0)
            kept[table.bodies[here | meets]] = True
            found = np.zeros(len(new) + 1, bool)
            found[table.tree[meets]] = True
            new = self._with_mates(found[:-1] | new) & ~trees
        return kept, trees

    def _with_mates(self, trees: np.ndarray) -> np.ndarray:
        """The trees [T], and those that wake with one of them."""
        table, asleep = self.table, self._data.tree_asleep
        for one, other in table.linked[self._eq_active[table.equality] != 0].tolist():
            if trees[one] or trees[other]:
                trees[one] = trees[other] = True
        for k in np.flatnonzero(trees & (asleep >= 0)):  # an island wakes as one; its trees form a ring
            mate = int(asleep[k])
            while mate >= 0 and not trees[mate]:
                trees[mate] = True
                mate = int(asleep[mate])
        return trees


def _keeps_distance(model: mujoco.MjModel, own: int, body: int, count: int) -> bool:
    """Whether a point keeps its distance to the anchor of a joint of `own`.

    Args:
      body: on whose chain the point is, `own` or below: its frame, or the anchor of one of its joints. count: how many
        of its joints, the first ones, may move the point.
    """
    if body == own:
        return int(model.body_jntnum[own]) == 1  # where no other joint lies between
    turns = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_BALL))
    first = int(model.body_jntadr[body])
    # joints that turn the body about its own frame leave that where it is
    if any(int(model.jnt_type[j]) not in turns or model.jnt_pos[j].any() for j in range(first, first + count)):
        return False
    between = int(model.body_parentid[body])
    while between != own:
        if model.body_jntnum[between]:
            return False
        between = int(model.body_parentid[between])
    return int(model.body_jntnum[own]) == 1


def _matrix(quat: np.ndarray) -> np.ndarray:
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quat)
    return out


def _trees_of_actuator(model: mujoco.MjModel, actuator: int) -> list[int]:
    """Trees that an actuator moves; all of them where it is not plain to see."""
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    joint = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    if kind in joint:
        return [int(model.body_treeid[model.jnt_bodyid[target]])]
    return list(range(model.ntree))
