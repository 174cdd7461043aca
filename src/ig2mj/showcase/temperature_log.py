"""What the cooking demo writes down: temperatures and truths at every control step, and when truths change."""

from __future__ import annotations

import csv
import dataclasses
import json
import pathlib
from typing import TYPE_CHECKING

from ig2mj.simulation import Simulation

if TYPE_CHECKING:
    from rich.table import Table

TABLE_EVERY = 5.0
"""s between rows of the table where nothing changes."""


@dataclasses.dataclass(frozen=True)
class Moment:
    """A predicate of one object changed. `step`: control steps taken until it was first seen so; `time` in s."""

    step: int
    time: float
    predicate: str
    object: str
    value: bool

    def __str__(self) -> str:
        return f"{self.object} is {'' if self.value else 'no longer '}{self.predicate.replace('_', ' ')}"


class TemperatureLog:
    """Grows by `record`.

    Attributes:
      objects: whose temperatures are written down. predicates: (predicate, object).
      times: s, one per row; row 0 is the start.
      temperatures: Celsius, {object: one per row}. truths: {(predicate, object): one per row}.
      moments: in the order in which they came.
    """

    def __init__(self, objects: tuple[str, ...], predicates: tuple[tuple[str, str], ...]):
        self.objects, self.predicates = objects, predicates
        self.times: list[float] = []
        self.temperatures: dict[str, list[float]] = {name: [] for name in objects}
        self.truths: dict[tuple[str, str], list[bool]] = {asked: [] for asked in predicates}
        self.moments: list[Moment] = []

    @property
    def steps(self) -> int:
        """Control steps taken since row 0."""
        return len(self.times) - 1

    def record(self, world: Simulation) -> list[Moment]:
        """Writes down the present; what has changed since the last row."""
        self.times.append(world.time)
        for name, values in self.temperatures.items():
            values.append(float(world.state("temperature", name)))
        changed = []
        for (predicate, name), values in self.truths.items():
            values.append(world.predicate(predicate, name))
            if len(values) > 1 and values[-1] != values[-2]:
                changed.append(Moment(self.steps, world.time, predicate, name, values[-1]))
        self.moments += changed
        return changed

    def first(self, predicate: str, name: str, value: bool = True) -> Moment | None:
        """When it first became so, or None."""
        return next((m for m in self.moments if (m.predicate, m.object, m.value) == (predicate, name, value)), None)

    def write_csv(self, file: pathlib.Path) -> None:
        """One line per control step: step, time_s, `<object>_celsius`..., `<predicate>_<object>` (0 or 1)..."""
        with file.open("w", newline="", encoding="utf-8") as out:
            writer = csv.writer(out)
            temperatures = [f"{name}_celsius" for name in self.objects]
            writer.writerow(["step", "time_s", *temperatures, *("_".join(p) for p in self.predicates)])
            for k, time in enumerate(self.times):
                heat = [f"{self.temperatures[name][k]:.4f}" for name in self.objects]
                writer.writerow([k, f"{time:.4f}", *heat, *(int(self.truths[p][k]) for p in self.predicates)])

    def write_json(self, file: pathlib.Path) -> None:
        """The same by columns, and the moments."""
        found = {
            "time_s": [round(t, 4) for t in self.times],
            "celsius": {name: [round(v, 4) for v in values] for name, values in self.temperatures.items()},
            "predicates": {" ".join(asked): values for asked, values in self.truths.items()},
            "moments": [dataclasses.asdict(moment) for moment in self.moments],
        }
        file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")

    def table(self) -> Table:
        """For the terminal: a row every `TABLE_EVERY` seconds, and one for every moment."""
        from rich.table import Table

        table = Table(title="temperatures", title_justify="left")
        for heading in ("time", *self.objects):
            table.add_column(heading, justify="right")
        table.add_column("what happens")
        events: dict[int, list[str]] = {}
        for moment in self.moments:
            events.setdefault(moment.step, []).append(str(moment))
        due = 0.0
        for k, time in enumerate(self.times):
            regular = time - self.times[0] >= due - 1e-6
            if not (regular or k in events or k == self.steps):
                continue
            due += TABLE_EVERY if regular else 0.0
            heat = (f"{round(self.temperatures[name][k], 1) + 0.0:.1f} C" for name in self.objects)
            table.add_row(f"{time:.2f} s", *heat, "; ".join(events.get(k, [])), style="bold" if k in events else None)
        return table
