"""The benchmarks' pictures, drawn from their rows."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def grouped_bars(
    file: pathlib.Path,
    title: str,
    groups: Sequence[str],
    series: Mapping[str, Sequence[float | None]],
    ylabel: str,
    log: bool = True,
) -> None:
    """Bars side by side per group, with their values written on them; None leaves a gap."""
    figure, axes = plt.subplots(
        figsize=(min(14.0, max(6.0, 0.4 * len(groups) * len(series))), 4.2), layout="constrained"
    )
    width = 0.8 / len(series)
    for k, (name, values) in enumerate(series.items()):
        places = [g + (k - (len(series) - 1) / 2) * width for g in range(len(groups))]
        shown = [(x, v) for x, v in zip(places, values, strict=True) if v is not None]
        bars = axes.bar([x for x, _ in shown], [v for _, v in shown], width, label=name)
        axes.bar_label(bars, labels=[f"{v:,.0f}" for _, v in shown], fontsize=7, rotation=90, padding=2)
    axes.set_xticks(range(len(groups)), groups)
    if log:
        axes.set_yscale("log")
    axes.margins(y=0.2)  # room for the values
    axes.set_ylabel(ylabel)
    axes.set_title(title, fontsize=10)
    figure.legend(fontsize=7, ncols=len(series), loc="outside lower center")
    figure.savefig(file, dpi=130)
    plt.close(figure)


def rates(rows: Sequence[Mapping], labels: Mapping[str, str]) -> dict[str, list[float | None]]:
    """Steps a second of one core by label, for `grouped_bars`: one number for each row that has it."""
    return {
        label: [row["rates"][name]["steps_per_cpu_s"] if name in row["rates"] else None for row in rows]
        for name, label in labels.items()
        if any(name in row["rates"] for row in rows)
    }


def stacked_bars(
    file: pathlib.Path, title: str, groups: Sequence[str], parts: Mapping[str, Sequence[float]], ylabel: str
) -> None:
    """One bar per group, made of parts."""
    figure, axes = plt.subplots(figsize=(max(6.0, 1.2 * len(groups)), 4.2), layout="constrained")
    bottom = [0.0] * len(groups)
    for name, values in parts.items():
        axes.bar(range(len(groups)), values, 0.6, bottom=bottom, label=name)
        bottom = [b + v for b, v in zip(bottom, values, strict=True)]
    axes.set_xticks(range(len(groups)), groups, fontsize=8)
    axes.set_ylabel(ylabel)
    axes.set_title(title, fontsize=10)
    axes.legend(fontsize=8)
    figure.savefig(file, dpi=130)
    plt.close(figure)


def lines(
    file: pathlib.Path, title: str, series: Mapping[str, Sequence[float]], every: int, xlabel: str, ylabel: str
) -> None:
    """One line per name; a point stands for `every` steps."""
    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    for name, values in series.items():
        axes.plot([every * (k + 1) for k in range(len(values))], values, label=name, linewidth=1.2)
    axes.set_yscale("log")
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    axes.set_title(title, fontsize=10)
    axes.legend(fontsize=7, ncols=2)
    figure.savefig(file, dpi=130)
    plt.close(figure)


def curves(
    file: pathlib.Path,
    panels: Mapping[str, Mapping[str, tuple[Sequence[float], Sequence[float]]]],
    xlabel: str,
    ylabel: str,
    log: bool = True,
) -> None:
    """A panel per name, in each a line per series of points (x, y). x is logarithmic, y too by default."""
    count = max(1, len(panels))
    figure, row = plt.subplots(1, count, figsize=(4.2 * count + 0.8, 4.2), layout="constrained", squeeze=False)
    for axes, (title, series) in zip(row[0], panels.items(), strict=False):
        for name, (x, y) in series.items():
            axes.plot(x, y, marker="o", markersize=3, linewidth=1.2, label=name)
        axes.set_xscale("log", base=2)
        if log:
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0)
        axes.set_xlabel(xlabel)
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.3)
        if series:
            axes.legend(fontsize=7)
    row[0][0].set_ylabel(ylabel)
    figure.savefig(file, dpi=130)
    plt.close(figure)
