"""Activities whose objects have one of several models of their category in each episode.

    chosen = choices_of(task, split, count=4)
    chosen.task          the home has all of the models, the goal is about whichever is in use
    chosen.tasks[k]      the task with the k-th choice, for rewards and experts

What varies are the objects that are added to the home for the activity, and the home's own one that it is about. All
of them change together: with choice k each has the k-th of its models, beginning again where there are fewer.

Axes: W worlds, K choices, P rows.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.layout import make_layout
from ig2mj.engine.registry import make_engine
from ig2mj.engine.snapshot import AXIS, Snapshot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.scene.additions import name_additions
from ig2mj.scene.bare_scenes import bare_scene
from ig2mj.scene.library import LibraryName, find_model, library
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.model_splits import models_with_parts
from ig2mj.scene.paths import scene_folder
from ig2mj.scene.scene import Scene
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.activity_objective import ActivityObjective
from ig2mj.tasks.relocation import with_names
from ig2mj.tasks.reward import ActivityMeasures
from ig2mj.tasks.splits import models_of
from ig2mj.tasks.task import Task
from ig2mj.worlds.model_swaps import ModelSwaps
from ig2mj.worlds.pool import Pool


@dataclasses.dataclass(frozen=True, eq=False)
class ModelChoices:
    """See the module's text.

    Attributes:
      base: the task with its usual models. task: with all models in its home. tasks: with each choice.
      roles: names of the objects that vary. names: [K][R] of those that take their parts. models: the same, models.
    """

    base: Task
    task: Task
    tasks: tuple[Task, ...]
    roles: tuple[str, ...]
    names: tuple[tuple[str, ...], ...]
    models: tuple[tuple[str, ...], ...]

    def swaps(self, scene: Scene) -> ModelSwaps:
        """In a scene of `task`."""
        return ModelSwaps(scene, self.roles, self.names)


def choices_of(task: Task, part: str, count: int, models: Sequence[str] = ()) -> ModelChoices:
    """The choices of a task.

    Args:
      part: of the models, "train" or "held_out". count: the most models of an object. models: those that are taken,
        "category/model", of whatever part; (): of the part.

    Raises:
      EngineError: nothing of the task varies, or a category has no model in this part. UnknownNameError: there is no
        such model.
    """
    home = load_manifest(scene_folder(task.home))
    taken = [entry.name for entry in home.objects]
    loose = [text for text in task.objects if "@" not in str(text) and ":" not in str(text)]
    named = dict(zip((n for n, _ in name_additions(taken, task.objects)), task.objects, strict=True))
    roles = {name: find_model(str(text)) for name, text in named.items() if text in loose}
    if not roles and task.objects_of_interest:
        own = task.objects_of_interest[0]
        category = own.rsplit("_", 1)[0]
        if category in library() and next(e for e in home.objects if e.name == own).fixed is False:
            roles = {own: None}
    if not roles:
        raise EngineError(f"{task.name}: none of its objects has other models (randomize: objects)")
    other_use = _of_the_other_grasping(task)
    found = dict[str, list[tuple[str, str]]]()
    added: list[Any] = []
    for role, model in roles.items():
        category = role.rsplit("_", 1)[0] if model is None else model.category
        pool, joined = models_with_parts(category)
        pool = [name for name in pool if name in joined or f"{category}/{name}" not in other_use]
        own = None if model is None else model.model
        if models:
            taken_models = _named(models, category, pool, task)
        else:
            taken_models = _most(models_of(pool, part, joined), joined, count)
        for name in taken_models:
            if name == own:
                found.setdefault(role, []).append((role, name))
                continue
            added.append(LibraryName(f"{category}/{name}"))
            found.setdefault(role, []).append(("", name))
    fresh = iter([n for n, _ in name_additions(taken, (*task.objects, *added))][len(task.objects) :])
    options = {role: [(name or next(fresh), model) for name, model in every] for role, every in found.items()}
    most = max(map(len, options.values()))
    sets = [[options[role][k % len(options[role])] for role in roles] for k in range(most)]
    tasks = tuple(_with_parts(task, {role: name for role, (name, _) in zip(roles, one, strict=True)}) for one in sets)
    whole = dataclasses.replace(
        task, objects=(*task.objects, *added), goal=_any_of(task.goal, [t.goal for t in tasks], roles)
    )
    return ModelChoices(
        task,
        whole,
        tuple(dataclasses.replace(one, objects=whole.objects) for one in tasks),
        tuple(roles),
        tuple(tuple(name for name, _ in one) for one in sets),
        tuple(tuple(model for _, model in one) for one in sets),
    )


def _with_parts(task: Task, names: Mapping[str, str]) -> Task:
    """The task in which other objects have these parts."""
    at_home = {here: name for name, here in task.roles.items()}
    own = {at_home.get(role, role): name for role, name in names.items()}
    return dataclasses.replace(with_names(task, names), roles={**task.roles, **own})


def _of_the_other_grasping(task: Task) -> set[str]:
    """Models that lie or stand as only the other kind of grasping takes them, such as knives on their handles."""
    if task.physical is None:
        return set()
    friction = {text for texts in task.physical.objects for text in texts}
    by_friction = set(map(str, task.objects)) <= friction
    found = set[str]()
    for category in {text.partition("/")[0] for text in friction}:
        models = [f"{category}/{name}" for name in library().get(category, ())]
        if models and models[0] not in friction:  # it has models of its own for friction
            found |= {name for name in models if (name in friction) != by_friction}
    return found


def _named(models: Sequence[str], category: str, pool: Sequence[str], task: Task) -> list[str]:
    """Of these models those of a category. Raises EngineError: none is. UnknownNameError: one is not in the pool."""
    found = [name.partition("/")[2] for name in models if name.partition("/")[0] == category]
    for name in found:
        if name not in pool:
            raise UnknownNameError(f"model of {category} for {task.name}", name, pool)
    if not found:
        raise EngineError(f"randomize: objects: models = {list(models)}: none is a {category}, which {task.name} needs")
    return found


def _most(models: list[str], joined: Mapping[str, str], count: int) -> list[str]:
    """So many models, those that the user put into the part among them first."""
    return [*(m for m in models if m in joined), *(m for m in models if m not in joined)][:count]


ATOM = re.compile(r"\([\w?.-]+(?: [\w?.-]+)*\)")
"""An expression without expressions in it."""


def _any_of(goal: str, goals: Sequence[str], roles: Mapping[str, Any]) -> str:
    """A goal in which what is said of a role is said of any of the objects that may have it: those that wait fulfil
    nothing."""
    own, others = ATOM.findall(goal), [ATOM.findall(one) for one in goals]

    def either(match: re.Match[str]) -> str:
        at = own.index(match.group(0))
        every = list(dict.fromkeys(found[at] for found in others))
        return every[0] if len(every) == 1 else f"(or {' '.join(every)})"

    return ATOM.sub(either, goal)


def widened(pool: Pool, base: Scene, scene: Scene) -> Pool:
    """Rows of a household in one with more objects behind its own, which wait where they start.

    Args:
      base: of the rows. scene: with the further objects and whatever agents.

    Raises:
      EngineError: the household is not the same in both.
    """
    bare = bare_scene(scene.folder, scene.requested)
    small, large = make_layout(base.model, base.tables), make_layout(bare.model, bare.tables)
    joints = [[m.joint(j).name for j in range(m.njnt)] for m in (base.model, bare.model)]
    names = base.object_names, bare.object_names
    if any(list(more[: len(few)]) != list(few) for few, more in (joints, names)):
        raise EngineError(f"'{scene.name}': its objects come in another order where more are added")
    first = make_engine("native", bare, 1).first_world()[0]
    rows, count = pool.physics.scene, pool.size
    values = {}
    for name, axis in AXIS.items():
        whole = np.broadcast_to(np.asarray(getattr(first.scene, name)), (count, *np.shape(getattr(first.scene, name))))
        whole, size = np.array(whole), small.scene_sizes[name]
        place = (..., slice(None, size), *(slice(None),) * (-axis - 1))
        whole[place] = np.asarray(getattr(rows, name))
        values[name] = whole
    known, every = (
        [(int(o), int(t)) for o, t in zip(one.unit_object, one.unit_tree, strict=True)][: one.num_object_units]
        for one in (small, large)
    )
    at = np.array([every.index(unit) for unit in known])
    touching = np.zeros((count, len(every), len(every)), bool)
    touching[:, at[:, None], at] = np.asarray(rows.touching)
    of_scene = dataclasses.replace(rows, **values, touching=touching)
    none = jax.tree.map(lambda a: np.broadcast_to(np.asarray(a), (count, *np.shape(a))), first.agents)
    physics = Snapshot(of_scene, none, pool.physics.time, pool.physics.model_fields)
    initial = initial_states(StateModel.of_manifest(bare.tables, bare.manifest), 1)

    def filled(like: Array, own: Array) -> np.ndarray:
        like, own = np.asarray(like), np.asarray(own)
        whole = np.array(np.broadcast_to(like, (count, *like.shape[1:])))
        if whole.shape[1:] == own.shape[1:]:
            return own
        whole[:, : own.shape[1]] = own
        return whole

    states = jax.tree.map(filled, initial, pool.states)
    return Pool(physics, states, scene.digest)


class VariedObjective:
    """The objective of an activity whose objects vary: in each world that of the choice in use."""

    def __init__(self, chosen: ModelChoices, robot: str, scene: Scene, model: StateModel):
        """As `ActivityObjective`."""
        listed = [dataclasses.replace(task, robots=chosen.task.robots) for task in chosen.tasks]
        self.parts = [ActivityObjective(task, robot, scene, model) for task in listed]
        self.tasks, self.swaps = tuple(listed), chosen.swaps(scene)
        first = self.parts[0]
        self.reward, self.terms, self.outcomes = first.reward, first.terms, first.outcomes
        base = ActivityObjective(dataclasses.replace(chosen.base, robots=chosen.task.robots), robot, scene, model)
        self.vectors = base.vectors

    def pick(self, view: PhysicsView, of_each: Sequence[Any]) -> Any:
        """What belongs to the choice in use, of pytrees of arrays [W, ...] for each."""
        active = self.swaps.active(view.object_pos)

        def one(*arrays: Array) -> Array:
            stacked = jnp.stack([jnp.asarray(a) for a in arrays])
            return stacked[active, jnp.arange(stacked.shape[1])]

        return jax.tree.map(one, *of_each)

    def measure(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        status: GoalStatus,
        row: Int[Array, "W"] | None,
        before: ActivityMeasures | None = None,
        action: Float[Array, "W n"] | None = None,
    ) -> ActivityMeasures:
        """See `Objective.measure`."""
        return self.pick(view, [part.measure(view, states, status, row, before, action) for part in self.parts])

    def rewards(self, before: ActivityMeasures, now: ActivityMeasures) -> dict[str, Float[Array, "W"]]:
        """See `Objective.rewards`."""
        return self.parts[0].rewards(before, now)

    def ended(self, now: ActivityMeasures, status: GoalStatus) -> tuple[Bool[Array, "W"], Bool[Array, "W"]]:
        """See `Objective.ended`."""
        return self.parts[0].ended(now, status)

    def info(self, view: PhysicsView, now: ActivityMeasures, status: GoalStatus) -> dict[str, Array]:
        """See `Objective.info`."""
        return self.pick(view, [part.info(view, now, status) for part in self.parts])

    def observe(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        now: ActivityMeasures,
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Float[Array, "W n"]]:
        """See `Objective.observe`."""
        return self.pick(view, [part.observe(view, states, now, status, time_left) for part in self.parts])
