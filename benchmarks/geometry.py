"""Time of adjacency rays and piece distances on this machine: `python benchmarks/geometry.py [--worlds 1 1024]`.

Rays: 50 pairs whose target has 16 hulls of 8 to 32 corners, 9 lines asked both ways (the 16 horizontal and 2 vertical
rays of iGibson's adjacency.py). Distances: 30 pairs of such hulls.
"""

from __future__ import annotations

import argparse
import time

import jax
import numpy as np
import scipy.spatial

from ig2mj.geometry.gjk import PosedPieces, piece_distance
from ig2mj.geometry.targets import RayTargets, lines_enter_targets
from ig2mj.scene.tables import PieceKind

PAIRS, PIECES, CORNERS, DISTANCES = 50, 16, 32, 30
ANGLES = np.arange(8) * np.pi / 8
LINES = np.concatenate([[[0, 0, 1]], np.stack([np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES], -1)]).astype(np.float32)
LENGTHS = np.array([5.0] + [1.0] * 8, np.float32)


def hulls(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Half-spaces [count, N, 4] and corners [count, 32, 3] of random ellipsoidal hulls."""
    corners, equations = [], []
    for _ in range(count):
        points = rng.normal(size=(int(rng.integers(8, CORNERS + 1)), 3))
        points *= np.array([0.1, 0.15, 0.2]) / np.linalg.norm(points, axis=1, keepdims=True)
        equations.append(scipy.spatial.ConvexHull(points).equations * [1, 1, 1, -1])
        corners.append(np.concatenate([points, np.repeat(points[:1], CORNERS - len(points), 0)]))
    planes = np.tile(np.array([0.0, 0.0, 0.0, 1.0]), (count, max(map(len, equations)), 1))
    for row, found in zip(planes, equations, strict=True):
        row[: len(found)] = found
    return planes.astype(np.float32), np.array(corners, np.float32)


def unit(rng: np.random.Generator, *shape: int) -> np.ndarray:
    quat = rng.normal(size=(*shape, 4))
    return (quat / np.linalg.norm(quat, axis=-1, keepdims=True)).astype(np.float32)


def timed(function, *args, repeat: int) -> tuple[float, float]:
    """Seconds of the first call, and of the fastest of the others."""
    spent = []
    for _ in range(repeat + 1):
        start = time.perf_counter()
        jax.block_until_ready(function(*args))
        spent.append(time.perf_counter() - start)
    return spent[0], min(spent[1:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 1024])
    rng = np.random.default_rng(0)
    planes, corners = hulls(rng, max(PIECES, 2 * DISTANCES))
    targets = RayTargets.from_pieces(
        np.zeros(PAIRS, int),
        np.zeros(PIECES, int),
        np.zeros(PIECES, int),
        rng.normal(size=(PIECES, 3)).astype(np.float32),
        unit(rng, PIECES),
        np.full(PIECES, PieceKind.POLYHEDRON),
        np.zeros((PIECES, 3), np.float32),
        planes[:PIECES],
    )
    rays = jax.jit(lambda pos, quat, o: lines_enter_targets(targets, pos, quat, o, LINES, LENGTHS))

    def pieces(index: slice, pos: jax.Array, quat: jax.Array) -> PosedPieces:
        return PosedPieces(
            np.full(DISTANCES, PieceKind.POLYHEDRON), np.zeros((DISTANCES, 3), np.float32), corners[index], pos, quat
        )

    @jax.jit
    def distances(pos, quat):
        a, b = slice(0, DISTANCES), slice(DISTANCES, 2 * DISTANCES)
        return piece_distance(pieces(a, pos[:, a], quat[:, a]), pieces(b, pos[:, b], quat[:, b])).distance

    print(f"{jax.devices()[0].device_kind}, {PAIRS} pairs x {PIECES} hulls x {len(LINES)} lines both ways; GJK")
    for worlds in parser.parse_args().worlds:
        repeat = 50 if worlds < 100 else 5
        pos = (rng.normal(size=(worlds, 2 * DISTANCES, 3)) * 0.5).astype(np.float32)
        quat = unit(rng, worlds, 2 * DISTANCES)
        origins = rng.normal(size=(worlds, PAIRS, 3)).astype(np.float32)
        first, best = timed(rays, pos[:, :1], quat[:, :1], origins, repeat=repeat)
        print(f"W={worlds}: rays {best * 1e6 / worlds:.0f} us per world (first call {first:.1f} s)")
        first, best = timed(distances, pos, quat, repeat=repeat)
        print(f"W={worlds}: {DISTANCES} distances {best * 1e6 / worlds:.0f} us per world (first call {first:.1f} s)")


if __name__ == "__main__":
    main()
