"""`ig2mj pool SCENE`: makes a pool of settled initial states for batched resets."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro


def run(
    scene: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    count: int = 64,
    out: pathlib.Path | None = None,
    seed: int = 0,
    share: float = 0.3,
    threads: int = 0,
    hand: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """Make a pool of settled initial states by disturbing a scene at random.

    Args:
      scene: folder of a converted scene, or the name of a home that comes with ig2mj.
      count: rows.
      out: the file; default: pool.npz in the scene's folder.
      seed: the same seed gives the same pool.
      share: probability that a loose object is moved, per row.
      threads: 0: one per processor.
      hand: make it for the scene with a floating hand, in the free place from which it reaches most loose objects
        (`ig2mj.calibration.reach.find_reach`), as `ig2mj calibrate` has it.
    """
    from ig2mj.cli.files import check_folder_of
    from ig2mj.cli.hand import with_hand
    from ig2mj.cli.printing import add_bar, progress_bar
    from ig2mj.errors import Ig2mjError
    from ig2mj.sampling.settled import make_pool
    from ig2mj.scene.scene import load_scene
    from ig2mj.states.model import StateModel
    from ig2mj.worlds.pool import save_pool

    if count < 1:
        raise Ig2mjError(f"--count {count}: a pool needs at least one row")
    if not 0 <= share <= 1:
        raise Ig2mjError(f"--share {share}: a probability is between 0 and 1")
    if threads < 0:
        raise Ig2mjError(f"--threads {threads}: 0 takes one per processor, else at least one is needed")
    loaded = load_scene(scene)
    file = out or loaded.folder / "pool.npz"
    check_folder_of(file)
    start: list[float] | None = None
    if hand:
        loaded, reach = with_hand(loaded, scene)
        start = reach.start.tolist()
    with progress_bar() as bar:
        report = add_bar(bar, f"settling {loaded.name}")
        pool = make_pool(
            loaded,
            StateModel.of_manifest(loaded.tables, loaded.manifest),
            count,
            seed=seed,
            share=share,
            threads=threads or None,
            progress=lambda done: report("", done, count),
        )
    save_pool(pool, file, loaded, {"seed": seed, "share": share, "hand": start})
    place = "" if start is None else f" with a hand at ({', '.join(f'{x:.3f}' for x in start)})"
    print(f"{file}: {pool.size} settled states of {loaded.name}{place}")
