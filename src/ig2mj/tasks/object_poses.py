"""`spread_starts`: start states of an activity whose objects are spread over all that is within reach.

The sampler draws them by the task's own rules, and by the same rules with other supports and with the clutter of the
supports drawn again:

- every piece of furniture of about the same height on which an object still is where the task wants it may bear it,
  unless the goal or the task is about that piece;
- loose things of the home that stand on the supports are put down again on the same support.

Of these start states those are taken that differ most in positions and headings (farthest points), so that corners of
the reachable region count as much as its middle.

Axes: P rows, F numbers that are compared.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
from jaxtyping import Float

from ig2mj.engine.layout import make_layout
from ig2mj.errors import EngineError
from ig2mj.geometry.poses import quat_to_matrix
from ig2mj.sampling.conditions import read_conditions
from ig2mj.scene.scene import Scene
from ig2mj.tasks.household import SITS, Household
from ig2mj.tasks.pools import COUNT, bare_scene, pool_of, start_states
from ig2mj.tasks.spots import ENOUGH, MARGIN, STEP
from ig2mj.tasks.task import Task
from ig2mj.worlds.pool import Pool, stack

HEIGHTS = 0.35
"""m by which another support may be higher or lower than the task's own."""

CLUTTER = 4
"""Loose things of the home that are put down again, the nearest ones."""

ON_IT = 0.03
"""m between the lowest point of what stands on a support and its top."""

OVERSAMPLED = 2
"""Start states that are drawn for each that is taken."""

HEADING = 0.1
"""m that count as much as the cosine or the sine of a heading changing by 1."""


def spread_starts(task: Task, split: str, count: int) -> Pool:
    """Start states that are as different as possible. Raises EngineError: none can be sampled.

    Args:
      split: "train" or "held_out", as of `pool_of`. count: rows, at most.
    """
    scene = bare_scene(task)
    pools = []
    for one in other_starts(task, scene):
        rows = max(OVERSAMPLED * count, min(start_states(one, split, scene).rows_at_hand, COUNT[split]))
        try:
            pools.append(dataclasses.replace(pool_of(one, split, rows), digest=None, starts=None))
        except EngineError:
            if one.start == task.start:
                raise
    whole = stack(pools) if len(pools) > 1 else pools[0]
    chosen = farthest(_features(task, scene, whole), count)
    return dataclasses.replace(whole.rows(chosen), digest=scene.digest, starts=None)


def other_starts(task: Task, scene: Scene) -> list[Task]:
    """The task, and the same with other start conditions. `scene`: its household."""
    home, found = Household(scene), [task]
    borne = [c.arguments for c in read_conditions(task.start) if c.predicate == "on_top" and len(c.arguments) == 2]
    clutter = [text for name, support in dict.fromkeys(borne) for text in _clutter(home, task, name, support)]
    if clutter:
        found.append(dataclasses.replace(task, start=(*task.start, *dict.fromkeys(clutter))))
    for name, support in borne:
        for other in _supports(home, task, name, support):
            old, new = f"(on_top {name} {support})", f"(on_top {name} {other})"
            found.append(dataclasses.replace(task, start=tuple(new if text == old else text for text in task.start)))
    return found


def farthest(features: Float[np.ndarray, "P F"], count: int) -> np.ndarray:
    """Numbers of the rows of which each is as far as possible from those before it, in ascending order."""
    chosen = [0]
    apart = np.linalg.norm(features - features[0], axis=1)
    while len(chosen) < min(count, len(features)):
        chosen.append(int(np.argmax(apart)))
        apart = np.minimum(apart, np.linalg.norm(features - features[chosen[-1]], axis=1))
    return np.sort(chosen)


def _features(task: Task, scene: Scene, pool: Pool) -> Float[np.ndarray, "P F"]:
    """Positions (m) and headings of the loose objects that the start conditions name."""
    address, qpos = make_layout(scene.model, scene.tables).object_qposadr, np.asarray(pool.physics.scene.qpos, float)
    named = dict.fromkeys(a for c in read_conditions(task.start) for a in c.arguments if a in scene.object_names)
    found = [np.zeros((len(qpos), 1))]
    for name in named:
        first = int(address[scene.object_index(name)])
        if first >= 0:
            ahead = np.asarray(quat_to_matrix(qpos[:, first + 3 : first + 7]))[:, :2, 0]
            found += [qpos[:, first : first + 3], HEADING * ahead]
    return np.concatenate(found, axis=1)


def _clutter(home: Household, task: Task, name: str, support: str) -> list[str]:
    """Conditions for what stands on a support of the home at its start, the nearest to where the object may be."""
    scene, tables = home.scene, home.scene.tables
    if support not in scene.object_names:
        return []
    low, high = home.box(support)
    middle = next((np.array(near.pos[:2]) for near in task.near if near.object == name), 0.5 * (low + high)[:2])
    found = []
    for number, other in enumerate(scene.object_names):
        loose = not home.fixed[number] and not tables.object_parked[number] and (home.owner == number).any()
        if not loose or other == name or other in task.objects_of_interest or _named(other, task):
            continue
        bottom, top = home.box(other)
        centre = 0.5 * (bottom + top)[:2]
        if abs(bottom[2] - high[2]) < ON_IT and (low[:2] < centre).all() and (centre < high[:2]).all():
            found.append((float(np.linalg.norm(centre - middle)), f"(on_top {other} {support})"))
    return [text for _, text in sorted(found)[:CLUTTER]]


def _supports(home: Household, task: Task, name: str, support: str) -> list[str]:
    """Other furniture on which the object is where the task wants it."""
    scene, limits = home.scene, [near for near in task.near if near.object == name]
    if support not in scene.object_names or not limits:
        return []
    own, found = home.box(support)[1][2], []
    for number, other in enumerate(scene.object_names):
        fixed = home.fixed[number] and (home.owner == number).any()
        if not fixed or other in task.objects_of_interest or _named(other, task):
            continue
        low, high = home.box(other)
        if high[2] < SITS or abs(high[2] - own) > HEIGHTS or ((high - low)[:2] < 2 * MARGIN).any():
            continue
        x, y = (np.arange(low[k] + MARGIN, high[k] - MARGIN, STEP) for k in (0, 1))
        points = np.stack([*(a.ravel() for a in np.meshgrid(x, y)), np.full(len(x) * len(y), high[2])], axis=1)
        good = np.ones(len(points), bool)
        for near in limits:
            apart = np.linalg.norm(points - near.pos, axis=1)
            good &= (apart >= near.least) & (apart <= near.most)
        if good.sum() >= ENOUGH:
            found.append(other)
    return found


def _named(name: str, task: Task) -> bool:
    """Whether the goal or the start conditions name an object."""
    return any(re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.])", text) for text in (task.goal, *task.start))
