"""Videos, strips of images and a gallery page of recordings of plans (`ig2mj solve --record`), by their frames."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.replay import Replayer
from ig2mj.demos.solving import PLAN
from ig2mj.errors import InputError
from ig2mj.files.content import decode_json
from ig2mj.process.spawning import worker_processes
from ig2mj.showcase.film_strip import ENDINGS
from ig2mj.showcase.plan_video import PlanVideo
from ig2mj.tasks.own_goal import split_goal_name

STRIP_SIZE, STRIP_FRAMES = (240, 180), 5
"""Pixels of an image of a strip, and their number."""
COLUMNS = 98
"""Of a line of a goal on a page."""


@dataclasses.dataclass(frozen=True)
class RecordedStep:
    """A step of a recorded plan: its words, its objects, and the frame after its last one."""

    words: str
    objects: tuple[str, ...]
    end: int


class RecordedPlan:
    """The plan of a run. Attributes: number: of the episode. steps: in order. seconds: simulated."""

    def __init__(self, recording: Recording, run: Run):
        """Raises InputError: the run has no plan, or a broken one."""
        if PLAN not in run.attributes:
            fix = "`ig2mj solve --record FILE` records plans"
            raise InputError(recording.file, "was not recorded by a planner", element=run.name, fix=fix)
        plan: Any = decode_json(str(run.attributes[PLAN]), recording.file)
        period, time, steps = float(recording.header.get("period", 0.1)), 0.0, []
        try:
            self.number = int(plan["number"])
            for step in plan["steps"]:
                time += float(step["time"])
                words = " ".join([str(step["primitive"]), *map(str, step["arguments"])])
                steps.append(RecordedStep(words, tuple(map(str, step["arguments"])), round(time / period)))
        except (KeyError, TypeError, ValueError):
            raise InputError(recording.file, "is not a plan", element=f"{run.name}/attribute {PLAN}") from None
        self.steps, self.seconds = tuple(steps), time

    def at(self, frame: int) -> RecordedStep | None:
        """The step that is carried out in a frame."""
        return next((step for step in self.steps if frame <= step.end), self.steps[-1] if self.steps else None)


def chosen_run(recording: Recording, number: int | None) -> Run:
    """A run by its number; None: the first that succeeds. Raises InputError: there is none."""
    runs = [run for run in recording.runs if run.frames > 1]
    if number is None:
        found = next((run for run in runs if run.success), None)
        if found is None:
            raise InputError(recording.file, "has no successful run", fix="name one (--run N)")
        return found
    if not 0 <= number < len(recording.runs):
        raise InputError(recording.file, f"has runs 0 to {len(recording.runs) - 1}, not {number}")
    return recording.runs[number]


def write_video(
    recording: Recording,
    file: str | os.PathLike,
    run: int | None = None,
    *,
    speed: float = 3.0,
    rate: float = 15.0,
    size: tuple[int, int] | None = None,
    progress: ProgressCallback = no_progress,
) -> RecordedPlan:
    """Writes a run as a video, or as a strip of images, one at the end of each of its main steps.

    Args:
      file: .mp4, .gif or .webp; .png or .jpg for a strip. run: number; None: the first that succeeds.
      speed: times real time. rate: frames in a second. size: pixels; None: usual ones.

    Raises:
      InputError: the recording has no such run, or was not recorded by a planner.
    """
    chosen = chosen_run(recording, run)
    plan = RecordedPlan(recording, chosen)
    strip = pathlib.Path(file).suffix.lower() in ENDINGS
    replayer = Replayer(recording, "state")
    env, world, last = replayer.env, chosen.world, chosen.frames - 1
    size = size or (STRIP_SIZE if strip else (640, 480))
    if strip:
        shown = strip_frames([0, *(min(step.end, last) for step in plan.steps)])
    else:
        shown = list(dict.fromkeys([*range(0, last + 1, max(1, round(speed / rate / env.period))), last]))
    video = PlanVideo(file, env, world, speed=speed, rate=rate, size=size, frames=STRIP_FRAMES if strip else 0)
    names, state = env.scene.object_names, None
    try:
        for k, frame in enumerate(shown):
            state = replayer.at(chosen, frame, state)
            step = plan.at(frame)
            objects = [names.index(n) for n in step.objects if n in names] if step is not None else []
            video.see(state, step.words if step is not None else "", objects, now=True)
            progress(k + 1, len(shown), f"{k + 1} of {len(shown)} images")
    finally:
        video.close()
    return plan


def strip_frames(ends: Sequence[int], count: int = STRIP_FRAMES) -> list[int]:
    """Frames of a strip: the first and the last one, and ends of steps that are spread evenly; where there are too few
    steps, frames in the middle of the longest gaps, too. `ends`: the first frame and those at which steps end."""
    found = sorted(set(ends))
    while 1 < len(found) < count and max(gaps := np.diff(found)) > 1:
        at = int(np.argmax(gaps))
        found.insert(at + 1, (found[at] + found[at + 1]) // 2)
    return [found[k] for k in np.linspace(0, len(found) - 1, count).round().astype(int)]


def write_gallery(
    files: Sequence[pathlib.Path],
    page: pathlib.Path,
    images: pathlib.Path,
    progress: ProgressCallback = no_progress,
    *,
    jobs: int = 1,
) -> int:
    """Writes a page with one strip of images for each recording that has a success; the number of strips.

    Args:
      page: Markdown file. images: folder of the strips, made if it is missing.
      jobs: processes that render, each with a home in memory.

    Raises:
      InputError: a recording is broken.
    """
    images.mkdir(parents=True, exist_ok=True)
    targets = [(file, images / f"{file.stem}.jpg", page.parent) for file in files]
    parts = []
    with worker_processes(jobs) if jobs > 1 else contextlib.nullcontext() as pool:
        sections = pool.map(_section, *zip(*targets, strict=True)) if pool else (_section(*one) for one in targets)
        for k, section in enumerate(sections):
            progress(k + 1, len(files), files[k].name)
            parts += [section] if section else []
    page.write_text("\n".join([_HEAD, *sorted(parts)]), encoding="utf-8")
    return len(parts)


def _section(file: pathlib.Path, image: pathlib.Path, folder: pathlib.Path) -> str:
    """The section of a recording on a page in a folder, and its strip; "" where no run of a plan succeeds."""
    with Recording(file) as recording:
        if not any(run.success and PLAN in run.attributes for run in recording.runs):
            return ""
        plan = write_video(recording, image)
        task, home = str(recording.header.get("task", "")), str(recording.header.get("scene", ""))
    own = split_goal_name(task)
    words = task.removeprefix("activity/").replace("_", " ")
    title = "A goal in a home" if own else f"{words[:1].upper()}{words[1:]}"
    goal = f"`{textwrap.fill(own[1], COLUMNS)}`\n\n" if own else ""
    about = f"Home {home}, {len(plan.steps)} primitives, {plan.seconds:.0f} s of simulated time."
    return f"## {title}\n\n{about}\n\n{goal}![{title}]({os.path.relpath(image, folder)})\n"


_HEAD = """# Gallery of solved activities

The humanoid carries these out in physics, by the planner ([planning](guide/planning.md)). A strip
has five moments of one recorded episode, from its start to its end; ends of primitives first.
`ig2mj demos gallery RECORDINGS --out docs/gallery.md` makes this page.
"""
