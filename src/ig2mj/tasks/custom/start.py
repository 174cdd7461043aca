"""`StartWorld`: the household in one world without robots, in which a task's `start` makes one start state.

    def start(self, home, rng):
        home.sample("(on_top mug_0 breakfast_table_0)")
        home.put("plate_0", home.pos("mug_0") + (0.2, rng.uniform(-0.1, 0.1), 0.0))

Each start state has a random stream of its own, which belongs to seed, row and attempt, so that pools are the same for
any number of processes. A state counts if everything is at rest and nothing that was put somewhere stands in something.

Axis: P rows.
"""

from __future__ import annotations

import collections
import functools
import sys

import jax
import numpy as np

from ig2mj.errors import InputError, PoseError
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import bind, read_conditions
from ig2mj.sampling.many import ATTEMPTS, ROW_BUDGET, make_sampler
from ig2mj.sampling.placement import RESTING_PENETRATION
from ig2mj.sampling.row import Row, RowSampler
from ig2mj.scene.scene import Scene
from ig2mj.tasks.custom.code import TaskCode, call, label_of, place_of
from ig2mj.worlds.pool import Pool, stack


class NoStart(Exception):
    """An attempt at a start state failed; another one follows."""


class StartWorld:
    """The household in one world without robots, in which a task's `start` makes one start state.

    Attributes: scene: the household.
    """

    def __init__(self, sampler: RowSampler, rng: np.random.Generator):
        """Binds a sampler, whose world is at the scene's start, and the random numbers of this attempt."""
        self._sampler, self._rng = sampler, rng
        self._states = sampler.start[1]
        self._put: set[int] = set()
        self.scene: Scene = sampler.query.scene
        sampler.query.load(sampler.start[0])

    def sample(self, *conditions: str) -> None:
        """Places objects and sets states so that conditions hold (`ig2mj.sampling.conditions`), all at rest.

        Raises:
          UnknownNameError, StateError, AbilityError, ExpressionError: a condition can never be made true.
        """
        requested = bind(read_conditions(conditions), self._sampler.model.tables, self._rng)
        begin = self._sampler.start
        self._sampler.start_from(self._sampler.query.save(), self._states)
        try:
            row = self._sampler.sample(requested, self._rng, Budget(ROW_BUDGET), reasons := collections.Counter())
        finally:
            self._sampler.start_from(*begin)
        if row is None:
            raise NoStart(next((reason for reason, _ in reasons.most_common(1)), "no room"))
        self._states = row.states

    def put(self, name: str, pos: object, yaw: float | None = None, quat: object = None) -> None:
        """Puts a loose object somewhere, at rest; it falls when the state settles.

        Args:
          pos: [3] m, world frame, of its frame. yaw: degrees about the vertical. quat: [4] w-x-y-z, instead of `yaw`.

        Raises:
          UnknownNameError: no such object. PoseError: it is fixed, or the pose is invalid.
        """
        index = self.scene.object_index(name)
        if self.scene.tables.object_fixed[index]:
            raise PoseError(f"object '{name}' is fixed to the house and cannot be moved")
        place = np.asarray(pos, float)
        turn = np.asarray(self._sampler.query.view.object_quat)[0, index] if quat is None else np.asarray(quat, float)
        if yaw is not None and quat is None:
            turn = np.array([np.cos(np.radians(yaw) / 2), 0.0, 0.0, np.sin(np.radians(yaw) / 2)])
        if place.shape != (3,) or turn.shape != (4,) or not np.isfinite([*place, *turn]).all() or not turn.any():
            raise PoseError(f"object '{name}' is put at a position of 3 and a rotation of 4 finite numbers")
        self._sampler.query.place(index, place, turn / np.linalg.norm(turn))
        self._put.add(index)

    def pos(self, name: str) -> np.ndarray:
        """[3] m, world frame: the origin of an object's frame. Raises UnknownNameError."""
        return np.array(np.asarray(self._sampler.query.view.object_pos)[0, self.scene.object_index(name)], float)

    def box(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """An object's lowest and highest corner, [3] m each. Raises UnknownNameError."""
        return self._sampler.query.box(self.scene.object_index(name))

    def settle(self) -> bool:
        """Lets everything come to rest; whether it does within three simulated seconds."""
        return self._sampler.query.settle()

    def holds(self, condition: str) -> bool:
        """Whether a condition holds now. Raises as `sample`."""
        requested = bind(read_conditions([condition]), self._sampler.model.tables, self._rng)
        return self._sampler.holds(requested, self._states)

    def finished(self) -> Row:
        """The state as it is, at rest. Raises NoStart."""
        query = self._sampler.query
        if np.asarray(query.view.awake).any() and not query.settle():
            raise NoStart("not at rest at the end")
        deepest = query.penetrations()
        for index in self._put:
            if deepest[index] > RESTING_PENETRATION:
                raise NoStart(f"{self.scene.object_names[index]} stands in something at the end")
        return Row(query.save(), self._states)


def start_rows(code: TaskCode, scene: Scene, seed: int, first: int, count: int) -> Pool | None:
    """Start states that a task's `start` makes: those of these rows that it can; None where it makes none.

    Raises:
      InputError: the function raised.
    """
    rows = list[Pool]()
    with jax.default_device(jax.local_devices(backend="cpu")[0]):
        for number in range(first, first + count):
            row = _row(code, _sampler(scene), seed, number)
            if row is not None:
                physics = jax.tree.map(lambda a: np.asarray(a)[None], row.physics)
                rows.append(Pool(physics, row.states, scene.digest))
    return stack(rows) if rows else None


@functools.lru_cache(maxsize=1)
def _sampler(scene: Scene) -> RowSampler:
    return make_sampler(scene)


def _row(code: TaskCode, sampler: RowSampler, seed: int, number: int) -> Row | None:
    assert code.start is not None
    reason = ""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, number, attempt])
        world = StartWorld(sampler, rng)
        try:
            good = call(code.start, world, rng)
            if good is not None and not isinstance(good, bool | np.bool_):
                problem = f"gives {type(good).__name__}: nothing, or False where the state is no good, is expected"
                raise InputError(place_of(code.start), problem, element=label_of(code.start))
            if good is None or good:
                return world.finished()
            reason = "start gave False"
        except NoStart as e:
            reason = str(e)
        except InputError as e:
            if not isinstance(e.__cause__, NoStart):
                raise
            reason = str(e.__cause__)
        finally:
            sampler.query.load(sampler.start[0])
    print(f"{code.name}: start state {number} is left out ({reason})", file=sys.stderr)
    return None
