"""Writes a dataset root in iGibson's layout: VERSION, metadata, materials, objects.

The same seed gives the same bytes. Models are built in a process pool; nothing outside the pool's results is random.
"""

from __future__ import annotations

import concurrent.futures
import json
import multiprocessing
import pathlib
import shutil
from collections.abc import Collection, Iterable, Mapping

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.errors import UnknownNameError
from ig2mj.knowledge import synset

from ..objects.catalogue import build_model, catalogue
from ..objects.entry import Entry
from ..shapes.sweeps import self_clashes
from .material_library import write_material_library
from .model_writer import write_model
from .specs import category_spec

VERSION = "2.2.0"  # iGibson 2.2.2 accepts 2.0.6 <= version < 2.2.3
BUILDING = ("ceilings", "floors", "walls")
#: Room types in the order of the semantic map's values (iGibson's dataset format).
ROOM_TYPES = (
    "bathroom", "bedroom", "childs_room", "closet", "corridor", "dining_room", "empty_room", "exercise_room", "garage",
    "home_office", "kitchen", "living_room", "lobby", "pantry_room", "playroom", "staircase", "storage_room",
    "television_room", "utility_room", "balcony", "library", "auditorium", "undefined",
)  # fmt: skip
CHUNK = 12  # models per task of the pool


def build_dataset(
    out: pathlib.Path,
    *,
    seed: int = 0,
    only: Iterable[str] | None = None,
    jobs: int | None = None,
    progress: ProgressCallback = no_progress,
) -> dict[str, int]:
    """Writes VERSION, metadata and all object models under `out`; what was in `out/objects/<category>` is replaced.

    Args:
      out: dataset root; made if absent.
      seed: of all random choices.
      only: categories to build; None: all. The metadata then cover just these.
      jobs: processes; None: one per core. 1 builds in this process.
      progress: called with (models done, models in all).

    Returns:
      {category: number of whole models written}. Raises UnknownNameError for a category that is not in the catalogue.
    """
    entries = _chosen(only)
    tasks = [(entry.category, index) for entry in entries for index in range(entry.count + entry.extra)]
    objects = out / "objects"
    objects.mkdir(parents=True, exist_ok=True)
    for entry in entries:
        shutil.rmtree(objects / entry.category, ignore_errors=True)
    sizes: dict[str, list[list[float]]] = {entry.category: [] for entry in entries}
    chunks = [(str(objects), seed, tasks[k : k + CHUNK]) for k in range(0, len(tasks), CHUNK)]
    usual = {entry.category: entry.count for entry in entries}
    for done, (category, size) in enumerate(_run(chunks, jobs), start=1):
        if len(sizes[category]) < usual[category]:  # models come in the order of their numbers
            sizes[category].append(size)
        progress(done, len(tasks))
    write_metadata(out, entries, sizes)
    write_material_library(out, seed)
    return {category: len(found) for category, found in sizes.items()}


def write_models(out: pathlib.Path, requested: Mapping[str, Collection[int]], seed: int = 0) -> None:
    """Writes some models of some categories, in this process, with metadata as for all models of these categories.

    Args:
      requested: category -> numbers of models.
    """
    entries = _chosen(requested)
    sizes: dict[str, list[list[float]]] = {}
    for entry in entries:
        bounds = [build_model(entry, index, seed).bounds() for index in range(entry.count)]
        sizes[entry.category] = [[float(v) for v in high - low] for low, high in bounds]
        for index in sorted(set(requested[entry.category])):
            write_model(build_model(entry, index, seed), out / "objects")
    write_metadata(out, entries, sizes)


def write_metadata(out: pathlib.Path, entries: list[Entry], sizes: dict[str, list[list[float]]]) -> None:
    """VERSION and metadata/*; sizes: bounding boxes of each category's whole models."""
    folder = out / "metadata"
    folder.mkdir(parents=True, exist_ok=True)
    specs = {entry.category: category_spec(entry, sizes[entry.category]) for entry in entries}
    lines = sorted({*BUILDING, *specs})
    fixed = {synset(entry.category) for entry in entries if entry.fixed} - {None}
    files = {
        out / "VERSION": VERSION + "\n",
        folder / "avg_category_specs.json": json.dumps(specs, indent=1, sort_keys=True) + "\n",
        folder / "categories.txt": "".join(f"{name}\n" for name in lines),
        folder / "room_categories.txt": "".join(f"{name}\n" for name in ROOM_TYPES),
        folder / "non_sampleable_categories.txt": "".join(f"{name}\n" for name in sorted(str(s) for s in fixed)),
    }
    for path, text in files.items():
        path.write_text(text, encoding="utf-8", newline="\n")


def _chosen(only: Iterable[str] | None) -> list[Entry]:
    entries = catalogue()
    if only is None:
        return list(entries.values())
    names = list(only)
    for name in names:
        if name not in entries:
            raise UnknownNameError("category", name, entries)
    return [entries[name] for name in sorted(set(names))]


def _run(chunks: list[tuple[str, int, list[tuple[str, int]]]], jobs: int | None):
    if jobs == 1 or len(chunks) == 1:
        for chunk in chunks:
            yield from _write_chunk(chunk)
        return
    context = multiprocessing.get_context("spawn")  # forking a process that has threads, as JAX does, can hang
    with concurrent.futures.ProcessPoolExecutor(jobs, context) as pool:
        for results in pool.map(_write_chunk, chunks):
            yield from results


def _write_chunk(chunk: tuple[str, int, list[tuple[str, int]]]) -> list[tuple[str, list[float]]]:
    objects, seed, tasks = chunk
    written = []
    for category, index in tasks:
        model = build_model(catalogue()[category], index, seed)
        assert not (clashes := self_clashes(model)), f"{model.model}: moving parts meet others: {clashes}"
        write_model(model, pathlib.Path(objects))
        low, high = model.bounds()
        written.append((category, [float(v) for v in high - low]))
    return written
