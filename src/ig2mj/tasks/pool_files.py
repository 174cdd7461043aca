"""Files of start states: pools that ship with the package, and those that are sampled on first use and kept.

A file holds the rows of one task and split in the order in which they are sampled, whatever number was asked for. A
pool of fewer rows is its first rows; one of more continues where the file ends. What the rows are made of is part of
the file's name (a digest of the scene's physics, the conditions, the version of the sampler's rules).

Simulated contacts round differently on different kinds of processor, and a sampler multiplies the difference. The pools
of the paper's activities therefore ship, in `pools/`, and are the same everywhere; `make pools` renews them. Rows are
rounded to single precision when they are sampled, so that every engine starts from the same numbers.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import pathlib
from collections.abc import Callable, Iterable

import jax
import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.unfinished import replacing
from ig2mj.process.compilation import cache_folder
from ig2mj.process.program_cache import say_not_kept
from ig2mj.scene.scene import Scene
from ig2mj.worlds.archive import read_header
from ig2mj.worlds.pool import Pool, load_pool, save_pool, stack

_HERE = pathlib.Path(__file__).resolve()

SHIPPED = next(
    (folder for folder in (_HERE.parents[3] / "pools", _HERE.parents[2] / "ig2mj_pools") if folder.is_dir()),
    _HERE.parents[2] / "ig2mj_pools",
)
"""Pools that come with the project: the folder of a checkout, or the one next to an installed package."""

TRIED = "tried"
"""In a file's header: candidates that were tried for its rows, good or not; the next row continues there."""

Sample = Callable[[int, int], Iterable[tuple[int, Pool | None]]]
"""`sample(tried, rows)` makes at least so many further rows, if it can, after so many candidates. It gives, batch by
batch, the number of candidates tried so far and the rows found among the new ones (None: there are none)."""

SAME = 1e-4
"""Metres, and units of quaternions, within which two rows are the same state."""


@dataclasses.dataclass(frozen=True)
class StartStates:
    """The start states of one task and split.

    Attributes:
      name: of the file, without its mark. scene: without agents. made_of: from a digest of the scene, what determines
        the rows. note: for the file's header, for people.
    """

    name: str
    scene: Scene
    made_of: Callable[[str], list[object]]
    note: dict[str, object] = dataclasses.field(default_factory=dict)

    @property
    def shipped(self) -> pathlib.Path | None:
        """The file that ships with the package; None: there is none."""
        return next((file for file in self._files(SHIPPED) if file.exists()), None)

    @property
    def cached(self) -> pathlib.Path:
        """The file in the user's cache, whether it exists or not."""
        files = self._files(cache_folder() / "pools")
        return next((file for file in files if file.exists()), files[0])

    @property
    def rows_at_hand(self) -> int:
        """Rows of the larger of both files."""
        files = [file for file in (self.shipped, self.cached) if file is not None and file.exists()]
        return max((load_pool(file, self.scene).size for file in files), default=0)

    def pool(self, rows: int, sample: Sample, file: pathlib.Path | None = None) -> Pool:
        """The first rows: from the file that ships, from the cache, or sampled now and kept.

        Args:
          rows: how many. file: where to keep what is sampled, and the only file to read; None: the cache. What cannot
            be written there is used all the same, after a line on stderr.

        Returns:
          A pool of so many rows, or of as many as `sample` finds.
        """
        kept = file or self.cached
        best: Pool | None = None
        tried = 0
        for known in (kept,) if file else (self.shipped, kept):
            if known is None or not known.exists():
                continue
            found = load_pool(known, self.scene)
            if found.size >= rows:
                return _first(found, rows)
            if best is None or found.size > best.size:
                best, tried = dataclasses.replace(found, digest=self.scene.digest, starts=None), _tried(known)
        pools = [] if best is None else [best]
        made = 0 if best is None else best.size
        for tried_so_far, new in sample(tried, rows - made):
            tried = tried_so_far
            if new is not None:
                pools.append(dataclasses.replace(_rounded(new), digest=self.scene.digest))
                made += new.size
            if made >= rows:
                break
        if not pools:
            raise ValueError("`sample` found no row and raised nothing")
        whole = stack(pools)
        try:
            kept.parent.mkdir(parents=True, exist_ok=True)
            save_pool(whole, kept, self.scene, {**self.note, TRIED: tried})
        except (OSError, InputError) as failure:
            if file is not None:
                raise
            cause = failure if isinstance(failure, OSError) else failure.__cause__
            say_not_kept(kept.parent, getattr(cause, "strerror", None) or type(failure).__name__, "start states")
        return _first(whole, rows)

    def _files(self, folder: pathlib.Path) -> list[pathlib.Path]:
        """Of the scene's physics, and of every byte of its files."""
        marks = [
            hashlib.blake2b(json.dumps(self.made_of(digest), default=str).encode(), digest_size=6).hexdigest()
            for digest in (self.scene.digest, self.scene.files_digest)
        ]
        return [folder / f"{self.name}-{mark}.npz" for mark in marks]


def different_rows(one: Pool, other: Pool) -> list[int]:
    """Numbers of the rows in which some joint position differs by more than `SAME`; of both pools' common length."""
    count = min(one.size, other.size)
    gap = np.abs(np.asarray(one.physics.qpos)[:count] - np.asarray(other.physics.qpos)[:count])
    return [int(row) for row in np.flatnonzero((gap > SAME).any(1))]


def file_of_bytes(content: bytes, file: pathlib.Path) -> None:
    """Puts a file that another process read in its place: never half of one, even if several processes do."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with replacing(file) as part:
        part.write_bytes(content)


def _tried(file: pathlib.Path) -> int:
    tried = read_header(file).get(TRIED, 0)
    if not isinstance(tried, int) or tried < 0:
        raise InputError(file, f"has {tried!r} tried candidates", fix="delete it; it is sampled again")
    return tried


def _first(pool: Pool, rows: int) -> Pool:
    return pool if pool.size <= rows else pool.rows(np.arange(rows))


def _rounded(pool: Pool) -> Pool:
    """With numbers that single precision holds; the arrays keep their dtypes."""

    def rounded(array: np.ndarray) -> np.ndarray:
        array = np.asarray(array)
        return array.astype(np.float32).astype(array.dtype) if np.issubdtype(array.dtype, np.floating) else array

    return jax.tree.map(rounded, pool)
