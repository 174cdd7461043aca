"""A process that makes factorisations of tiles for Warp's cache; see `ig2mj.engine.warp.tiles`, which starts it.

It reads a JSON object from stdin: `folder`, the cache; `architecture`; and `tiles`, the arguments of Warp's function.
"""

from __future__ import annotations

import json
import sys
import types
from typing import Any

FLOAT32 = 5
"""cuSOLVERDx's number for single precision."""


def make(tiles: list[list[Any]], architecture: int) -> None:
    """Puts into Warp's cache what is not there. The function of Warp's is not public: see `tiles.builder`.

    Args:
      tiles: of each the fields of `ig2mj.engine.warp.tiles.Tile`.
    """
    from warp._src import build

    nowhere: Any = types.SimpleNamespace(ltoirs={}, ltoirs_decl={}, fatbins={})
    for rows, columns, name, function, side, diagonal, first, second, triangle, threads in tiles:
        arranged = (name, function, side, diagonal, first, second, triangle)
        build.build_lto_solver(rows, columns, 1, *arranged, architecture, FLOAT32, threads, "", nowhere)


def main() -> None:
    """Ends with an error where it finds another cache than the one it was given."""
    order = json.load(sys.stdin)
    import warp as wp

    wp.init()
    assert wp.config.kernel_cache_dir == order["folder"]
    make(order["tiles"], order["architecture"])


if __name__ == "__main__":
    main()
