"""Checkpoints of a run: what was learned, written so that a kill at any moment leaves the one before.

A folder `checkpoints/<iteration>` holds the arrays (orbax) and `meta.json`. It is written under another name and then
renamed; the newest three are kept. A broken one is passed over for the one before, with a line that says so.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import pathlib
import re
import shutil
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import numpy as np

from ig2mj.cluster.locks import hold
from ig2mj.cluster.team import Team
from ig2mj.errors import InputError
from ig2mj.files.content import read_json
from ig2mj.files.heartbeat import Heartbeat, is_alive
from ig2mj.files.unfinished import unfinished
from ig2mj.tasks.custom.code import IN_FILES

SIGN = ".alive"
"""In a checkpoint that is being written: the writer's sign of life."""

_NUMBER = re.compile(r"0|[1-9][0-9]{0,17}", re.ASCII)

KEPT = 3
"""Checkpoints of a run that stay."""

FORMAT_VERSION = 2
"""Of `meta.json` and of the arrays; version 0.1 of the package wrote none."""


TAKEN = "holds a run already: --resume continues it; or choose another --out"
"""Why a new run cannot use a folder with checkpoints."""


@contextlib.contextmanager
def only_run(out: str | os.PathLike | None) -> Iterator[None]:
    """While this lasts no other run can have the folder `out`, which is made. None: there is no folder.

    Raises:
      ClusterError: another run has it.
    """
    if out is None:
        yield
        return
    folder = pathlib.Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    with hold(folder / ".lock", folder):
        yield


class OldCheckpoint(InputError):
    """A checkpoint of another version of the package: its arrays have other names."""


class Checkpoints:
    """Those of one run's folder."""

    def __init__(self, run: str | os.PathLike):
        """`run`: the run's folder; made when something is saved."""
        self.folder = pathlib.Path(run).absolute() / "checkpoints"

    def numbers(self) -> list[int]:
        """Iterations of which there is a checkpoint, oldest first."""
        if not self.folder.is_dir():
            return []
        return sorted(int(f.name) for f in self.folder.iterdir() if _NUMBER.fullmatch(f.name))

    def save(self, number: int, tree: Any, meta: Mapping[str, Any]) -> pathlib.Path:
        """Writes a checkpoint, and removes the oldest.

        Args:
          number: of the iteration. tree: arrays. meta: for JSON; counters, and what the run depends on.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        target = self.folder / str(number)
        partial = unfinished(target)
        partial.mkdir()
        with Heartbeat(partial / SIGN):
            with _checkpointer() as writer:
                writer.save(partial / "arrays", _full(_leaves(tree)))
            text = json.dumps({"format": FORMAT_VERSION, **meta}, indent=1)
            (partial / "meta.json").write_text(text, encoding="utf-8")
        if target.exists():
            shutil.rmtree(target)
        partial.replace(target)
        for old in self.numbers()[:-KEPT]:
            shutil.rmtree(self.folder / str(old), ignore_errors=True)
        for left in self.folder.glob(".*"):  # of a process that was killed while it wrote
            if left.is_dir() and not is_alive(left / SIGN, left):
                shutil.rmtree(left, ignore_errors=True)
        return target

    def meta(self, number: int) -> dict[str, Any]:
        """Of one checkpoint. Raises InputError."""
        file = self.folder / str(number) / "meta.json"
        found = read_json(file, kind=dict)
        if not isinstance(found.get("depends"), dict):
            raise InputError(file, "does not say what it is of", element="depends")
        if "format" not in found:
            raise OldCheckpoint(file, "is a checkpoint of version 0.1", fix="ig2mj 0.1.0 continues that run")
        if found["format"] != FORMAT_VERSION:
            raise OldCheckpoint(file, f"has format {found['format']}, and {FORMAT_VERSION} can be read")
        return found

    def newest(self, like: Any, depends: Mapping[str, Any]) -> tuple[Any, dict[str, Any]] | None:
        """The newest checkpoint that can be read; None where there is none.

        Args:
          like: arrays of the shapes that are expected. depends: what the run depends on; `meta["depends"]` must be the
            same.

        Raises:
          InputError: a checkpoint is of another run: the message names the setting that differs.
        """
        for number in reversed(self.numbers()):
            folder = self.folder / str(number)
            try:
                meta = self.meta(number)
            except OldCheckpoint:
                raise
            except InputError as e:
                print(f"{e}; the checkpoint before it is taken", file=sys.stderr)
                continue
            refuse_difference(folder, meta["depends"], depends)
            try:
                expected = _leaves(like)
                with _checkpointer() as reader:
                    _check_shapes(reader.metadata(folder / "arrays"), _full(expected))
                    leaves = {**expected, **reader.restore(folder / "arrays", _full(expected))}
            except Exception as e:  # what orbax raises for half a file has no type of its own
                why = " ".join(str(e).split())[:120]
                print(f"{folder}: broken ({why}); the checkpoint before it is taken", file=sys.stderr)
                continue
            arrays = [np.asarray(leaves[name]) for name in expected]
            return jax.tree.unflatten(jax.tree.structure(like), arrays), meta
        return None


def _checkpointer() -> Any:
    """Orbax's, for this process alone: by default it waits for all processes of `jax.distributed`."""
    import orbax.checkpoint as ocp

    own = jax.process_index()
    alone = ocp.options.MultiprocessingOptions(
        primary_host=own, active_processes={own}, barrier_sync_key_prefix=f"process{own}"
    )
    return ocp.StandardCheckpointer(multiprocessing_options=alone)


def _check_shapes(metadata: Any, expected: Mapping[str, np.ndarray]) -> None:
    """Raises ValueError where a checkpoint's arrays are others than expected: orbax unpacks whatever there is."""
    found = dict(metadata.item_metadata.tree)
    for name, like in expected.items():
        if name not in found:
            raise ValueError(f"{name} is missing")
        shape, dtype = tuple(found[name].shape), np.dtype(found[name].dtype)
        if shape != like.shape or not np.can_cast(dtype, like.dtype, "same_kind"):
            raise ValueError(f"{name} is {dtype}{list(shape)}, and {like.dtype}{list(like.shape)} is expected")
        chunk = getattr(found[name].storage, "chunk_shape", None) or shape
        if math.prod(chunk) > max(like.size, 1):
            raise ValueError(f"{name} has chunks of shape {chunk}")


def newest(
    checkpoints: Checkpoints, like: Any, depends: Mapping[str, Any], team: Team
) -> tuple[Any, dict[str, Any]] | None:
    """`Checkpoints.newest` for all processes of a team: the first one reads, and gives the others what it found.

    A replay buffer, gigabytes of which each process needs only its own part, is read by each of them instead.
    """
    if team.count == 1 or "buffer" in like:
        with team.turns():
            return checkpoints.newest(like, depends)
    found = checkpoints.newest(like, depends) if team.first else None
    meta = team.barrier("the checkpoint", None if found is None else found[1])
    if meta is None:
        return None
    return same(like if found is None else found[0], team), meta


def same(tree: Any, team: Team) -> Any:
    """What the first process of a team has, in all of them; all must have arrays of these shapes."""
    if team.count == 1:
        return tree
    from jax.experimental.multihost_utils import broadcast_one_to_all

    return jax.tree.map(np.asarray, broadcast_one_to_all(jax.tree.map(np.asarray, tree), team.first))


def whole(tree: Any, team: Team) -> Any:
    """Arrays that are shared out over the devices of a team, as each process can read them; all must ask."""
    if team.count == 1:
        return tree
    from jax.experimental.multihost_utils import process_allgather

    def one(array: jax.Array) -> np.ndarray:
        return np.asarray(array if array.is_fully_replicated else process_allgather(array, tiled=True))

    return jax.tree.map(one, tree)


def _leaves(tree: Any) -> dict[str, np.ndarray]:
    """Arrays by their path in a tree; of what other processes hold, only the shape."""

    def read(array: Any) -> Any:
        there = not isinstance(array, jax.Array) or array.is_fully_addressable or array.is_fully_replicated
        return np.asarray(array) if there else np.empty(array.shape, array.dtype)

    return {jax.tree_util.keystr(path): read(a) for path, a in jax.tree_util.tree_leaves_with_path(tree)}


def _full(leaves: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Without empty arrays, such as images of a run without any: orbax refuses them."""
    return {name: array for name, array in leaves.items() if array.size}


def refuse_difference(
    file: object, found: Mapping[str, Any], expected: Mapping[str, Any], error: type[InputError] = InputError
) -> None:
    """Raises `error` for the first setting that differs, with both values."""
    as_read = json.loads(json.dumps(dict(expected)))
    for name in [*as_read, *(n for n in found if n not in as_read)]:
        if name in IN_FILES and name in as_read and name not in found:
            continue  # of a BDDL definition, before version 0.2
        if found.get(name) != as_read.get(name):
            if name == "task_code" and name in as_read:
                problem = f"what determines {as_read.get('task')} in {as_read.get('task_file')} has changed since"
                raise error(file, problem, fix="train again, or bring that version of the file back")
            raise error(
                file, f"was made for {name} = {_short(found.get(name))}; you asked for {_short(as_read.get(name))}"
            )


def _short(value: Any) -> str:
    text = value if isinstance(value, str) and value else json.dumps(value)
    return text if len(text) < 100 else f"{text[:90]} ..."
