"""The cooking demo's plot: two temperatures, their thresholds, and the moments at which predicates change."""

from __future__ import annotations

import pathlib

from ig2mj.showcase.kitchen import Kitchen
from ig2mj.showcase.temperature_log import TemperatureLog

FISH_COLOUR, MILK_COLOUR, STOVE_COLOUR = "#c8502d", "#2d6fa8", "#e8a33d"


def plot(log: TemperatureLog, kitchen: Kitchen, file: pathlib.Path) -> None:
    """Writes an image; its kind is the file's ending."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for start, end in _on(log, kitchen):
        axes.axvspan(start, end, color=STOVE_COLOUR, alpha=0.15, lw=0, label="stove toggled on")
    colours = {kitchen.fish: FISH_COLOUR, kitchen.milk: MILK_COLOUR}
    for name in log.objects:
        axes.plot(log.times, log.temperatures[name], color=colours[name], lw=2, label=name)
    for celsius, what, colour, lift in (
        (kitchen.cook, "cooked", FISH_COLOUR, 3),
        (kitchen.burn, "burnt", FISH_COLOUR, 3),
        (kitchen.freeze, "frozen", MILK_COLOUR, -12),
    ):
        axes.axhline(celsius, color=colour, lw=0.8, ls="--")
        axes.annotate(f"{what} at {celsius:g} °C", (1, celsius), xycoords=("axes fraction", "data"), ha="right",
                      xytext=(-4, lift), textcoords="offset points", color=colour, fontsize=9)  # fmt: skip
    for moment in log.moments:
        if moment.object not in colours or not moment.value:
            continue
        celsius, colour = log.temperatures[moment.object][moment.step], colours[moment.object]
        axes.plot(moment.time, celsius, "o", color=colour, ms=7)
        axes.annotate(f"{moment}\n{moment.time:.1f} s", (moment.time, celsius), xytext=(-8, 8), ha="right",
                      textcoords="offset points", color=colour, fontsize=9)  # fmt: skip
    axes.set(xlabel="simulated time (s)", ylabel="temperature (°C)", xlim=(log.times[0], log.times[-1]))
    axes.margins(y=0.12)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False)
    figure.savefig(file, dpi=120)


def _on(log: TemperatureLog, kitchen: Kitchen) -> list[tuple[float, float]]:
    """When the stove was on: (from, to) in s."""
    spans, since = [], None
    for time, on in zip(log.times, log.truths["toggled_on", kitchen.stove], strict=True):
        if on and since is None:
            since = time
        elif not on and since is not None:
            spans.append((since, time))
            since = None
    return [*spans, (since, log.times[-1])] if since is not None else spans
