"""One world for the commands that show states: loaded, set up, and simulated for some seconds."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal

from ig2mj.errors import Ig2mjError
from ig2mj.process.progress import progress

if TYPE_CHECKING:
    from ig2mj.simulation import Simulation

LONGEST, PART = 1e7, 10.0
"""s: the longest time that commands simulate, and of what is simulated between two reports."""


def started(
    scene: pathlib.Path,
    compat: Literal["paper", "igibson"],
    seconds: float,
    settings: Sequence[str],
    check: Callable[[Simulation], object] = lambda world: None,
    objects: Sequence[str] = (),
) -> Simulation:
    """The scene's world after `settings` ("STATE=OBJECT" or "STATE=OBJECT=VALUE") and `seconds`.

    Args:
      check: of the other arguments of a command; raises before anything is set or simulated.
      objects: what is added to the home (`load_home`).
    """
    check_seconds(seconds)
    parsed = [_parsed(setting) for setting in settings]
    from ig2mj.cli.common.objects import load_home
    from ig2mj.simulation import Simulation
    from ig2mj.states.options import StateOptions

    world = Simulation(load_home(scene, objects), states=StateOptions(compat=compat))
    check(world)
    for name, name_of_object, value in parsed:
        world.set_state(name, name_of_object, value)
    simulate(lambda count: world.step(count=count), seconds, world.engine.substeps * world.engine.timestep)
    return world


def check_seconds(seconds: float) -> None:
    """Raises Ig2mjError: `--seconds` is no time that can be simulated."""
    if not 0 <= seconds <= LONGEST:
        raise Ig2mjError(f"--seconds {seconds:g} must be between 0 and {LONGEST:g}")


def simulate(step: Callable[[int], object], seconds: float, period: float) -> None:
    """Takes steps of `period` s for `seconds`, with progress; between parts of the way Ctrl-C is heard.

    Args:
      step: takes that many steps.
    """
    total, done = round(seconds / period), 0
    part = max(1, round(PART / period))
    with progress("simulating") as report:
        while done < total:
            report(done, total, f"{done * period:.0f} of {total * period:.0f} s")
            count = min(part, total - done)
            step(count)
            done += count


def _parsed(setting: str) -> tuple[str, str, bool | float]:
    parts = setting.split("=")
    if len(parts) not in (2, 3) or not all(parts):
        raise Ig2mjError(f"--set {setting}: write STATE=OBJECT or STATE=OBJECT=VALUE, e.g. temperature=fish_0=80")
    if len(parts) == 2:
        return parts[0], parts[1], True
    word = parts[2].lower()
    if word in ("true", "yes", "on", "false", "no", "off"):
        return parts[0], parts[1], word in ("true", "yes", "on")
    try:
        return parts[0], parts[1], float(word)
    except ValueError:
        raise Ig2mjError(f"--set {setting}: '{parts[2]}' is neither a number nor true or false") from None
