"""How much of BEHAVIOR-1K can be done: which definitions can be expressed, which fit a home, which can be sampled.

- *Expressible*: every predicate, substance and transition rule that it needs is here.
- *Fits*: a home, with what the object library adds to it, has every object that it names.
- *Sampled*: a start state was found with at least `ENOUGH` of `SEEDS` seeds in such a home: rows of a pool, each with
  its own generator. Results of sampling are kept in a folder, one file for each definition.
"""

from __future__ import annotations

import collections
import dataclasses
import json
import math
import os
import pathlib
import time
from collections.abc import Iterable, Sequence
from typing import Any

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.job_runner import Where, map_jobs
from ig2mj.cluster.jobs import Job, JobSet
from ig2mj.errors import EngineError, Ig2mjError
from ig2mj.scene.manifest import Manifest, load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.tasks.bddl.definitions import activity_names, load_activity
from ig2mj.tasks.bddl.start import HOMES, fitting, load_bound, sample_start
from ig2mj.tasks.bddl.vocabulary import VocabularyError

SEEDS, ENOUGH = 10, 8

LACKS, OF = "nothing stands for ", " lacks "
"""Beginnings and middles of reasons for which a home does not fit (`ig2mj.tasks.bddl.binding`)."""


@dataclasses.dataclass(frozen=True)
class Coverage:
    """One definition.

    Attributes:
      lacks: what it needs that is not here; empty: it is expressible. homes: that fit, the best first.
      missing: why no home fits, of the home that lacks least. sampled: seeds with a start state; None: not all were
        tried. first: some seed had one.
    """

    name: str
    lacks: tuple[str, ...] = ()
    homes: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    sampled: int | None = None
    first: bool = False

    @property
    def why_not(self) -> str:
        """Why the definition is not sampled, in words; "" where no reason is known."""
        if self.lacks:
            return f"no state for {', '.join(self.lacks)}"
        if self.missing:
            return "; ".join(self.missing)
        if self.sampled is not None and self.sampled < ENOUGH:
            return f"start states of {self.sampled} of {SEEDS} seeds"
        return ""


def cover(
    homes: Sequence[Manifest],
    results: pathlib.Path | None = None,
    names: Sequence[str] | None = None,
    progress: ProgressCallback = no_progress,
) -> list[Coverage]:
    """All definitions.

    Args:
      homes: manifests in which they are bound. results: folder of `sample_definition`. names: only these definitions.

    Raises:
      MissingDependencyError: they are not fetched.
    """
    found = []
    wanted = activity_names(True) if names is None else list(names)
    for done, name in enumerate(wanted):
        progress(done, len(wanted), name)
        found.append(_one(name, homes, results))
    progress(len(wanted), len(wanted), "")
    return found


def _one(name: str, homes: Sequence[Manifest], results: pathlib.Path | None) -> Coverage:
    try:
        activity = load_activity(name, True)
    except VocabularyError as e:
        return Coverage(name, e.predicates)
    bound, errors = fitting(activity, homes)
    if not bound:
        return Coverage(name, missing=tuple(min(errors.values(), key=len)) if errors else ("no homes",))
    file = None if results is None else results / f"{name}.json"
    said = json.loads(file.read_text(encoding="utf-8")) if file is not None and file.is_file() else {}
    sampled = said["sampled"] if said.get("tried", 0) >= SEEDS else None
    return Coverage(name, homes=tuple(b.home for b in bound), sampled=sampled, first=said.get("sampled", 0) > 0)


def sample_definitions(
    names: Sequence[str],
    homes: Sequence[str],
    results: pathlib.Path,
    seconds: float,
    seeds: int = SEEDS,
    minutes: float = math.inf,
    jobs: int = 1,
    progress: ProgressCallback = no_progress,
) -> dict[str, str]:
    """Samples start states of definitions, and writes down how many were found: `<name>.json` for each.

    Results that are there already are continued with the missing seeds.

    Args:
      homes: names of shipped homes. seconds: wall time for each seed. seeds: with how many of `SEEDS` seeds.
      minutes: after which no definition is begun. jobs: processes; 0: one per processor.

    Returns:
      Why definitions failed with an error, by name.
    """
    results.mkdir(parents=True, exist_ok=True)
    common = {"homes": list(homes), "results": str(results), "seconds": seconds, "seeds": seeds}
    end = time.time() + 60 * minutes
    work = [Job(name, {**common, "name": name, "end": None if math.isinf(end) else end}) for name in names]
    title = "sampling start states"
    return map_jobs(JobSet("ig2mj.tasks.bddl.coverage:sample_job", title, work), Where(jobs), progress=progress)[1]


def sample_job(
    name: str, homes: Sequence[str], results: str, seconds: float, seeds: int, end: float | None = None
) -> bytes:
    """One definition; arguments as of `sample_definitions`. `end`: seconds since the epoch; nothing is begun later."""
    if end is not None and time.time() > end:
        return b""
    file = pathlib.Path(results) / f"{name}.json"
    said: dict[str, Any] = {"activity": name, "tried": 0, "sampled": 0, "seconds": seconds, "rejected": {}}
    if file.is_file():
        said |= json.loads(file.read_text(encoding="utf-8"))
    if said["tried"] >= seeds:
        return b""
    try:
        _sample_more(said, name, homes, seconds, seeds)
    except (EngineError, Ig2mjError) as e:
        said |= {"failed": str(e), "tried": seeds}
    written = file.with_suffix(f".{os.getpid()}")
    written.write_text(json.dumps(said) + "\n", encoding="utf-8")
    written.replace(file)
    return b""


def _sample_more(said: dict[str, Any], name: str, homes: Sequence[str], seconds: float, seeds: int) -> None:
    """Tries the seeds that are missing. Of the first `HOMES` homes that fit the first in which the first seed works."""
    manifests = [load_manifest(scene_folder(home)) for home in homes]
    bound, _ = fitting(load_activity(name, True), manifests)
    chosen = [b for b in bound if b.home == said.get("home")] or bound[:HOMES]
    for binding in chosen:
        scene, first = load_bound(binding), int(said["tried"])
        done = sample_start(binding, scene, seeds - first if first else 1, first=first, seconds_per_row=seconds)
        reasons = collections.Counter(said["rejected"]) + collections.Counter(dict(done.sampled.rejected))
        said["rejected"] = dict(reasons.most_common(8))
        found = len(done.sampled.rows)
        if found or binding is chosen[-1]:
            home = binding if found else chosen[0]
            said |= {"home": home.home, "tried": done.sampled.requested + first, "sampled": said["sampled"] + found}
            break
    if said["tried"] < seeds:
        _sample_more(said, name, homes, seconds, seeds)


def counts(rows: Iterable[Coverage]) -> dict[str, int]:
    """definitions, expressible, fits and sampled."""
    rows = list(rows)
    return {
        "definitions": len(rows),
        "expressible": sum(not r.lacks for r in rows),
        "fits": sum(bool(r.homes) for r in rows),
        "sampled": sum((r.sampled or 0) >= ENOUGH for r in rows),
    }


def lacking(rows: Iterable[Coverage]) -> dict[str, int]:
    """What definitions lack that nothing here expresses, with the number that lack only that."""
    alone = collections.Counter(r.lacks[0] for r in rows if len(r.lacks) == 1)
    return dict(alone.most_common())


def missing(rows: Iterable[Coverage]) -> dict[str, int]:
    """Synsets of objects of which homes and library have none, with the number of definitions that lack only that."""
    alone = collections.Counter[str]()
    for row in rows:
        names = {_synset(reason) for reason in row.missing}
        if len(names) == 1 and "" not in names:
            alone[names.pop()] += 1
    return dict(alone.most_common())


def _synset(reason: str) -> str:
    words = reason.removeprefix(LACKS) if reason.startswith(LACKS) else reason.partition(OF)[2].partition(" ")[2]
    name = words.split(" ")[0]
    return name if ".n." in name else ""


def page(rows: Sequence[Coverage]) -> str:
    """A page of documentation about all definitions."""
    found = counts(rows)
    lines = [
        "# BEHAVIOR-1K",
        "",
        "Written by `ig2mj activity coverage --page FILE`, not by hand. A definition is *expressible* if",
        "every predicate, substance and transition rule that it needs is here. It *fits* if a home that",
        "ships, with objects of the library, has every object. It is *sampled* if a start state was found",
        f"with {ENOUGH} of {SEEDS} seeds (`-`: not tried).",
        "",
        "| definitions | expressible | fit | sampled |",
        "|--:|--:|--:|--:|",
        f"| {found['definitions']} | {found['expressible']} | {found['fits']} | {found['sampled']} |",
        "",
        "## What is not expressed",
        "",
        "| needs | definitions that lack only this |",
        "|---|--:|",
        *(f"| {name} | {count} |" for name, count in lacking(rows).items()),
        "",
        "## What no home and no model stands for",
        "",
        "| synset | definitions that lack only this |",
        "|---|--:|",
        *(f"| {name} | {count} |" for name, count in list(missing(rows).items())[:150]),
        "",
        "## Definitions",
        "",
        "| definition | expressible | fits | sampled | why not |",
        "|---|---|--:|--:|---|",
    ]
    for row in rows:
        sampled = "-" if row.sampled is None else str(row.sampled)
        said = "no" if row.lacks else "yes"
        lines.append(f"| {row.name} | {said} | {len(row.homes) or '-'} | {sampled} | {row.why_not.replace('|', '/')} |")
    return "\n".join(lines) + "\n"
