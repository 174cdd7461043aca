"""`sample_settled`: the rows of `make_pool`, in pieces of work: on several processes, on a cluster, with a journal.

A piece is one turn of `ig2mj.sampling.settled.Disturber`. How many turns are needed shows only as they come: pieces are
handed out until there are enough rows, and the first ones, in the order of the turns, are the pool.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence

import jax

from ig2mj.cluster.journal import Journal, Memory
from ig2mj.cluster.pieces import Report, Where, run
from ig2mj.cluster.work import Piece, WholeRunError, Work
from ig2mj.errors import EngineError
from ig2mj.sampling.offered import check_of, lent, named, scene_named
from ig2mj.sampling.settled import Disturber, most_turns, too_few, width_of
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.worlds.archive import build, pack, unpack
from ig2mj.worlds.pool import Pool, stack


def sample_settled(
    scene: Scene,
    count: int,
    seed: int = 0,
    share: float = 0.3,
    *,
    where: Where | None = None,
    journal: Journal | None = None,
    report: Report = lambda status: None,
) -> tuple[Pool | None, dict[str, str]]:
    """Samples rows; the pool is that of `make_pool`, wherever the pieces are done.

    Args:
      scene: without agents. count, seed, share: as `make_pool` has them.
      journal: keeps finished turns, and takes turns that fail; without one they end everything.

    Returns:
      The pool, None where turns failed; and by the name of a turn, why it failed.

    Raises:
      EngineError: too few rows come to rest. ClusterError: see `ig2mj.cluster.pieces.run`.
    """
    width, store = width_of(count), Memory() if journal is None else journal
    common = {**named(scene), "seed": seed, "share": share, "width": width}
    pieces: list[Piece] = []
    pools: list[Pool] = []
    made = 0
    try:
        while made < count and len(pieces) < most_turns(count):
            yielded = made / len(pieces) if pieces else width  # rows a turn
            more = -(-(count - made) // max(yielded, 1.0))
            until = min(len(pieces) + int(more), most_turns(count))
            pieces += [Piece(f"turn_{n:06d}", {**common, "turn": n}) for n in range(len(pieces), until)]
            title = f"settling {scene.name}"
            work = Work("ig2mj.sampling.settled_pieces:turn_piece", title, pieces, check=check_of(scene))
            with lent(scene):
                _, failed = run(work, where or Where(), store, report)
            if failed and journal is None:
                raise EngineError(next(iter(failed.values())))
            if failed:
                return None, failed
            pools = [pool for piece in pieces for pool in _unpacked(store.get(piece.name), piece.name)]
            made = sum(pool.size for pool in pools)
    finally:
        _disturber.cache_clear()
    if made < count:
        raise too_few(scene, count, made)
    return dataclasses.replace(jax.tree.map(lambda a: a[:count], stack(pools)), digest=scene.digest), {}


def turn_piece(scene: str, objects: Sequence[str], seed: int, share: float, width: int, turn: int) -> bytes:
    """The rows of one turn, packed as a pool; no arrays where there are none."""
    try:
        rows = _disturber(scene, tuple(objects), width).rows(turn, seed, share)
    except EngineError as e:
        raise WholeRunError(e) from e
    return pack(stack(rows) if rows else {}, {})


def _unpacked(packed: bytes, name: str) -> list[Pool]:
    arrays, _ = unpack(packed)
    return [build(Pool, arrays, name)] if arrays else []


@functools.lru_cache(maxsize=1)
def _disturber(name: str, objects: tuple[str, ...], width: int) -> Disturber:
    scene = scene_named(name, objects)
    return Disturber(scene, StateModel.of_manifest(scene.tables, scene.manifest), width, threads=1)
