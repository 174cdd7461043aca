"""`ig2mj calibrate SCENE...`: measures the Warp engine's buffers for scenes and writes them next to their manifests."""

from __future__ import annotations

import pathlib
import sys
from typing import Annotated, Literal

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot


def run(
    scenes: Annotated[tuple[pathlib.Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SCENE...")] = (),
    engine: Literal["auto", "warp", "native"] = "auto",
    worlds: int = 0,
    rounds: int = 6,
    seed: int = 0,
    safety: float = 0.0,
    hand: bool = True,
    robot: str | None = None,
    own: Own = NONE,
    object: AddedObjects = (),
    out: pathlib.Path | None = None,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """Measure the buffer sizes that the Warp engine needs for scenes.

    Args:
      scenes: folders of converted scenes, or names of homes that come with ig2mj.
      engine: engine to measure with; auto: warp where JAX has a GPU, else native.
      worlds: number of worlds measured in parallel; 0: 1,024 on warp, 16 on native.
      rounds: number of rounds, two simulated seconds each.
      seed: random seed of the disturbance.
      safety: factor applied to all sizes; 0: 1 for warp, 1.4 for native.
      hand: let a floating hand push objects around.
      robot: what disturbs the scene: hand (it pushes objects; the default), or a robot that acts at random: {robots},
        or a folder that `ig2mj convert robot` wrote. The profile is named after it.
      object: {object}. Needs --out: a home's own profile is of the home as it is.
      out: write profiles to OUT/<scene's name>/ instead of next to the manifests.
      json: print the profiles as JSON, by scene.
    """
    from ig2mj.errors import Ig2mjError

    if not scenes:
        raise Ig2mjError("name at least one scene: a folder that `ig2mj convert` wrote, or a home that ships")
    if worlds < 0 or rounds < 1 or not 0 <= safety < float("inf"):
        raise Ig2mjError("--worlds and --safety must be finite and not negative, --rounds at least 1")
    if object and out is None:
        raise Ig2mjError("--object needs --out DIR: the profile next to a home is of the home as it is")
    from ig2mj.calibration.measuring import calibrate
    from ig2mj.cli.common.printing import add_bar, print_json, progress_bar, stdout_console
    from ig2mj.engine.warp.profile import profile_file, save_profile

    chosen = choose_robot(robot, own) or "hand"
    profiles = {}
    for scene in scenes:
        if chosen == "hand":
            loaded, reach = _with_hand(scene, object, hand)
        else:
            loaded, reach = _with_robot(scene, object, chosen), None
        with progress_bar() as bar:
            report = add_bar(bar, f"disturbing {loaded.name}")
            profile = calibrate(
                loaded,
                reach,
                engine="" if engine == "auto" else engine,
                num_worlds=worlds,
                rounds=rounds,
                seed=seed,
                safety=safety,
                progress=report,
            )
        folder = loaded.folder if out is None else out / loaded.folder.name
        folder.mkdir(parents=True, exist_ok=True)
        file = save_profile(profile, folder, profile_file(loaded.agents))
        profiles[loaded.name] = profile
        if not json:
            stdout_console().print(_table(f"{loaded.name}: {file}", profile, loaded.model))
    if json:
        print_json(profiles)


def _with_hand(scene: pathlib.Path, objects: tuple[str, ...], hand: bool):
    """The scene with a hand where it reaches most objects, and what it reaches; without a hand if it reaches none."""
    from ig2mj.cli.common.hand import with_hand
    from ig2mj.errors import EngineError
    from ig2mj.scene.scene import load_scene

    loaded = load_scene(scene, objects=objects)
    if not hand:
        return loaded, None
    try:
        return with_hand(loaded, scene)
    except EngineError as e:
        print(f"note: {e}; measured without a hand", file=sys.stderr)
        return loaded, None


def _with_robot(scene: pathlib.Path, objects: tuple[str, ...], robot: str):
    """The scene with a robot at the free position where a hand reaches most objects, else at the robot's own start."""
    from ig2mj.agents.registry import make_robot
    from ig2mj.calibration.reach import find_reach
    from ig2mj.errors import EngineError
    from ig2mj.scene.scene import load_scene

    body = make_robot(robot)
    try:
        x, y, _ = find_reach(load_scene(scene, objects=objects)).start
    except EngineError as e:
        print(f"note: {e}; the robot stands at its own start", file=sys.stderr)
        return load_scene(scene, [body], objects)
    return load_scene(scene, [body.at(x, y, 0.0)], objects)


def _table(title: str, profile, model):
    """Buffer use of a world in a step (quantiles, maximum), and the sizes of the buffers."""
    from rich.table import Table

    from ig2mj.engine.warp.profile import default_profile

    measured, safe = profile.measured, default_profile(model)
    table = Table("per world", "1 %", "0.01 %", "peak", "mean", "size", "spare", "safe", title=title)
    table.caption = (
        "exceeded in 1 % and 0.01 % of steps, most, largest mean; size chosen; once more per batch; uncalibrated"
    )

    def row(label: str, key: str, size: int, spare: str, safe_size: int) -> None:
        seen = [str(measured.get(f"{what}_{key}", "")) for what in ("p99", "p9999", "peak", "mean")]
        table.add_row(label, *seen, str(size), spare, str(safe_size))

    row("awake dofs", "awake_dofs", profile.awake_dofs, "", safe.awake_dofs)
    row("constraints", "constraints", profile.constraints, "", safe.constraints)
    row("contacts", "contacts", profile.contacts, str(profile.spare_contacts), safe.contacts)
    row("geom pairs", "pairs", profile.convex_contacts, str(profile.spare_convex_contacts), safe.convex_contacts)
    return table
