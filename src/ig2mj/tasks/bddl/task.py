"""`BddlTask`: an activity that BDDL defines, bound to a home, as a task for environments.

    env = ig2mj.make("activity/cleaning_up_after_a_meal", robot="fetch")

The home is the shipped one in which the least has to be added, of those that have room for it. Start states are
sampled on first use and kept. The robot starts on free floor, as near as it can be to what the activity is about.
"""

from __future__ import annotations

import collections
import dataclasses
import hashlib
import json
import sys
from collections.abc import Iterator

import numpy as np

from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.files.content import read_text
from ig2mj.process.progress import progress
from ig2mj.sampling import surface_particles
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder, shipped_homes
from ig2mj.scene.scene import Scene
from ig2mj.tasks.bddl.binding import Binding, BindingError
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.start import fitting, load_bound, sample_start, start_conditions
from ig2mj.tasks.custom.code import TaskCode
from ig2mj.tasks.pool_files import StartStates
from ig2mj.tasks.pools import SEEDS, VERSION
from ig2mj.worlds.pool import Pool

PREFIX = "activity/"

DEFINITION = ".bddl"
"""Ending of a file with a definition."""

HORIZON = 1000
"""Agent steps: 100 s."""

ROWS = 16
"""Start states unless another number is asked for."""

NO_ROOM = frozenset({("cleaning_the_hot_tub", "juniper")})
"""Activities and homes that have what they need, and no room for it: no start state can be sampled
(`benchmarks.sampling.behavior_starts`)."""

TRIES = 2
"""Candidates for each start state that is asked for, after which a pool has fewer."""


@dataclasses.dataclass(frozen=True)
class BddlTask:
    """See the module's text.

    Attributes:
      name: "activity/" and the activity's name. summary: one sentence. binding: which objects of the home play it.
      robots: names of those that can do it. horizon, grasping, code: as of `ig2mj.tasks.task.Task`.
      added: further objects in the home (`ig2mj.tasks.added_objects`).
    """

    name: str
    summary: str
    binding: Binding
    robots: tuple[str, ...] = ("humanoid", "fetch")
    horizon: int = HORIZON
    grasping: str = "assisted"
    added: tuple[str, ...] = ()
    code: TaskCode | None = dataclasses.field(default=None, repr=False)

    @property
    def home(self) -> str:
        """Name of the home."""
        return self.binding.home

    def objects_in(self, scene: Scene) -> tuple[str, ...]:
        """Names of the scene's objects that the activity is about."""
        return tuple(dict.fromkeys(n for n in self.binding.objects.values() if n in scene.object_names))


def bddl_task(name: str) -> BddlTask:
    """The task of an activity's name, with or without "activity/".

    Raises:
      UnknownNameError: no such activity. BindingError: no home has what it needs. See also `load_activity`.
    """
    short = name.removeprefix(PREFIX)
    activity = load_activity(short)
    bound, errors = fitting(activity, [load_manifest(scene_folder(home)) for home in shipped_homes()])
    if not bound:
        home, reasons = min(errors.items(), key=lambda item: len(item[1]))
        raise BindingError(activity.name, home, reasons)
    binding = next((b for b in bound if (activity.name, b.home) not in NO_ROOM), bound[0])
    words = activity.name.replace("_", " ")
    summary, code = f"{words[0].upper()}{words[1:]}.", _code(short, activity.name)
    return BddlTask(PREFIX + activity.name, summary, binding, code=code)


def _code(file: str, name: str) -> TaskCode | None:
    """Of a definition of the user's; None of one that ships."""
    if not file.endswith(DEFINITION):
        return None
    text = read_text(file, fix="name a BDDL definition")
    return TaskCode(file, PREFIX + name, hashlib.blake2b(text.encode(), digest_size=16).hexdigest())


def activity_pool(task: BddlTask, split: str = "train", count: int | None = None) -> Pool:
    """Start states of the bare household, read from the cache or sampled now; fewer where no more can be sampled.

    Raises:
      UnknownNameError: no such split. EngineError: none could be sampled.
    """
    states, requested = activity_states(task, split), count or ROWS

    def sample_rows(tried: int, rows: int) -> Iterator[tuple[int, Pool | None]]:
        print(f"sampling {rows} start states of {task.name} in {task.home}, once", file=sys.stderr)
        made, last, reasons, reached = 0, tried + TRIES * requested, collections.Counter[str](), False
        while made < rows and tried < last:
            count = min(rows - made, last - tried)
            with progress(f"sampling start states of {task.name}") as report:
                done = sample_start(
                    task.binding,
                    states.scene,
                    count,
                    SEEDS[split],
                    first=tried,
                    progress=lambda done, _, text="", made=made: report(made + done, rows, f"{made + done} of {rows}"),
                )
            tried += count
            reasons += done.sampled.rejected
            reached |= bool(done.reached)
            drawn = done.sampled.pool
            good = np.setdiff1d(np.arange(0 if drawn is None else drawn.size), done.reached)
            made += len(good)
            yield tried, drawn.rows(good) if drawn is not None and len(good) else None
        if not made and tried == last and rows == requested:
            if reached:
                raise EngineError(f"{task.name} is already done in every start state that was sampled")
            raise EngineError(f"no start of {task.name} could be sampled: {dict(reasons.most_common(3))}")

    return states.pool(requested, sample_rows)


def activity_states(task: BddlTask, split: str = "train") -> StartStates:
    """Where the start states are kept, and what they are made of. Raises UnknownNameError: no such split."""
    if split not in SEEDS:
        raise UnknownNameError("split", split, SEEDS)
    bare = load_bound(task.binding, added=task.added)
    conditions = [c.expression for c in start_conditions(task.binding, bare)]
    dirty = any(word in json.dumps(conditions, default=str) for word in ("dusty", "stained"))
    rules = [surface_particles.VERSION] if dirty else []
    short = task.name.removeprefix(PREFIX)
    return StartStates(
        f"{short}-{split}",
        bare,
        lambda digest: [VERSION, digest, conditions, *rules],
        {"task": task.name, "split": split},
    )
