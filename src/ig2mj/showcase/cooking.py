"""The cooking demo: a hand switches the stove on, the fish in the pan cooks and burns, the milk in the fridge freezes.

Nothing is scripted but the hand, which presses the stove's button at the start and again when the fish has burnt. The
rest is the physics and the states of `Simulation`, with the taxonomy's numbers: a stove of 500 C and rate 0.02 that
reaches 0.2 m, a fridge of -18 C and rate 0.02 for what is inside (iGibson's object_states).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ig2mj.showcase.button_hand import ButtonHand
from ig2mj.showcase.kitchen import Kitchen
from ig2mj.showcase.temperature_log import Moment, TemperatureLog
from ig2mj.simulation import Simulation

FIRST_PRESS = 15
"""Control steps until the hand sets out."""
LONGEST = 48.0
"""s after which the demo ends whatever has happened."""
AFTERWARDS = 30
"""Control steps that it goes on when all has happened."""

Watcher = Callable[[TemperatureLog, Sequence[Moment]], None]
"""Called at the start and after every control step with the log so far and what has just changed."""


def cook(world: Simulation, kitchen: Kitchen, watch: Watcher | None = None) -> TemperatureLog:
    """Runs the demo from the world's present state.

    Args:
      world: with the hand of `enter_kitchen`.
      watch: takes images, reports progress.
    """
    fish, milk, stove = kitchen.fish, kitchen.milk, kitchen.stove
    log = TemperatureLog(
        (fish, milk), (("toggled_on", stove), ("cooked", fish), ("burnt", fish), ("frozen", milk))
    )  # fmt: skip
    seconds = world.engine.substeps * world.engine.timestep
    hand = ButtonHand(kitchen.approach, seconds)
    left = AFTERWARDS
    log.record(world)
    if watch:
        watch(log, [])
    for step in range(round(LONGEST / seconds)):
        if step == FIRST_PRESS:
            hand.press()
        world.step(hand.ctrl())
        changed = log.record(world)
        if any(m.predicate == "burnt" and m.value for m in changed):
            hand.press()
        if watch:
            watch(log, changed)
        left -= not missing(log, kitchen) and hand.at_rest
        if left < 0:
            break
    return log


def missing(log: TemperatureLog, kitchen: Kitchen) -> list[str]:
    """What was to happen and has not."""
    requested = [
        ("toggled_on", kitchen.stove, True),
        ("cooked", kitchen.fish, True),
        ("burnt", kitchen.fish, True),
        ("toggled_on", kitchen.stove, False),
        ("frozen", kitchen.milk, True),
    ]
    return [
        str(Moment(0, 0.0, predicate, name, value))
        for predicate, name, value in requested
        if log.first(predicate, name, value) is None
    ]
