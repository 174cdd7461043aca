"""`ig2mj calibrate SCENE`: measures the Warp engine's buffers for a scene and writes them beside its manifest."""

from __future__ import annotations

import functools
import pathlib
from typing import Annotated, Literal

import tyro


def run(
    scene: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    engine: Literal["auto", "warp", "native"] = "auto",
    worlds: int = 0,
    rounds: int = 6,
    seed: int = 0,
    safety: float = 0.0,
    hand: bool = True,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """Measure how large the batched engine's buffers must be for a scene.

    Args:
      scene: folder of a converted scene, or the name of a home that comes with ig2mj.
      engine: what to measure with; auto takes warp where JAX has a GPU.
      worlds: measured side by side; 0: 1,024 on warp, 8 on native.
      rounds: of two simulated seconds each.
      seed: of the disturbance.
      safety: factor on the peaks; 0: 1.5 for warp, 2 for native.
      hand: let a floating hand push objects about.
      json: print the profile as JSON.
    """
    import msgspec
    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table

    from ig2mj.agents.floating_hand import add_floating_hand
    from ig2mj.agents.reach import find_reach
    from ig2mj.calibration import calibrate
    from ig2mj.engine.profile import default_profile, save_profile
    from ig2mj.scene.scene import load_scene

    loaded, reach = load_scene(scene), None
    if hand:
        reach = find_reach(loaded)
        loaded = load_scene(scene, [functools.partial(add_floating_hand, pos=reach.start)])
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(f"disturbing {loaded.name}", total=rounds)
        profile = calibrate(
            loaded,
            reach,
            engine="" if engine == "auto" else engine,
            num_worlds=worlds,
            rounds=rounds,
            seed=seed,
            safety=safety,
            progress=lambda done, total: bar.update(task, completed=done),
        )
    file = save_profile(profile, loaded.folder)
    if json:
        print(msgspec.json.encode(profile).decode())
        return
    safe = default_profile(loaded.model)
    table = Table("buffer, per world", "peak", "size", "without calibration", title=f"{loaded.name}: {file}")
    for name in ("awake_dofs", "constraints", "contacts", "convex_contacts"):
        peak, size = str(profile.measured[f"peak_{name}"]), str(getattr(profile, name))
        table.add_row(name, peak, size, str(getattr(safe, name)))
    Console().print(table)
