"""Success against training time of the runs on file, beside the rates that the paper states.

    python benchmarks/learning_curves.py

Reads `progress.csv` files of `ig2mj train` in benchmarks/results/learning, named
ENVIRONMENT-ROBOT-GRASPING-ALGORITHM-OBSERVATION-SEED.csv, and writes a plot for each environment and robot and a table
(curves.md) there. A row's success is that of the episodes that ended since the row before, exploration noise included;
in the first seconds only those that succeeded have ended, so a run counts as there once every later row is, too.
"""

from __future__ import annotations

import collections
import csv
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

FOLDER = pathlib.Path(__file__).parent / "results" / "learning"

PAPER = {
    "GraspingBook": (100, 25),
    "SoakingTowel": (100, 25),
    "CleaningStainedShelf": (100, 0),
    "CookingMeat": (100, 0),
    "SlicingFruit": (15, 0),
    "BimanualPickAndPlace": (0, None),
}
"""Success in per cent of the bimanual humanoid with mittens, and of Fetch without them (appendix A.3)."""

REMARK = """
PointNavigation and Reaching were trained on two cores, the others on one H200, from rgbd with another run beside them
on the card ("sac+expert" alone). "Held out": of the mean actions of the last policy, on 1,000 start states that
training never saw. With DAgger and with "sac+expert" (`--expert`) the scripted expert helps; the paper's runs had
none. The DAgger runs here stopped too early, since success then counted episodes that the expert had a part in.
SlicingFruit with `--expert`: the first run was cut off; "48_updates" has `guided=0.4 copied=0.25 reach=30
updates=48`; "trusted" `guided=0.4 copied=0.4 trust=1 reach=30 updates=48`; "rgbd64" the same with `--pixels 64`, cut
off at second 161.
"""

GOOD = 95.0
"""Per cent that a run is meant to reach."""


def read(file: pathlib.Path) -> list[tuple[float, float, float]]:
    """Seconds of training, million environment steps and success in per cent, where episodes had ended."""
    with file.open() as rows:
        return [
            (float(r["seconds"]), float(r["env_steps"]) / 1e6, 100 * float(r["success"]))
            for r in csv.DictReader(rows)
            if r["success"] not in ("", "nan")
        ]


def held_out(file: pathlib.Path) -> str:
    """Success on held-out start states in per cent, where it was measured with mean actions; else nothing."""
    rows = file.with_suffix(".evaluations.jsonl")
    found = [json.loads(line) for line in rows.read_text().splitlines()] if rows.is_file() else []
    found = [row for row in found if row["split"] == "held_out" and not row.get("drawn")]
    return f"{100 * found[-1]['success_rate']:.1f} %" if found else ""


def reached(curve: list[tuple[float, float, float]], least: float = GOOD) -> float | None:
    """Seconds after which success never falls below `least` again; None: it ends below."""
    since = None
    for seconds, _, success in curve:
        if success < least:
            since = None
        elif since is None:
            since = seconds
    return since


def main() -> None:
    groups: dict[tuple[str, str], list[tuple[str, list, str]]] = collections.defaultdict(list)
    for file in sorted(FOLDER.glob("*.csv")):
        environment, robot, grasping, algorithm, observation, seed = file.stem.split("-")
        label = f"{algorithm} from {observation}, {grasping}, seed {seed}"
        groups[environment, robot].append((label, read(file), held_out(file)))
    lines = [
        "| environment | robot | run | trained (s) | million steps | 95 % from (s) | last row | held out | paper |"
    ]
    lines.append("|---|---|---|--:|--:|--:|--:|--:|--:|")
    for (environment, robot), runs in groups.items():
        figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
        paper = PAPER.get(environment, (None, None))[0 if robot == "humanoid" else 1]
        for label, curve, unseen in runs:
            axes.plot([s / 60 for s, _, _ in curve], [p for _, _, p in curve], label=label, linewidth=1.4)
            since = reached(curve)
            lines.append(
                f"| {environment} | {robot} | {label} | {curve[-1][0]:.0f} | {curve[-1][1]:.2f} | "
                f"{'never' if since is None else f'{since:.0f}'} | {curve[-1][2]:.1f} % | {unseen} | "
                f"{'' if paper is None else f'{paper} %'} |"
            )
        if paper is not None:
            axes.axhline(
                paper, color="black", linestyle=":", linewidth=1, label=f"paper, after its training: {paper} %"
            )
        axes.set(xlabel="minutes of training (compilation apart)", ylabel="success, %", ylim=(-3, 103))
        axes.set_title(f"{environment}, {robot}", fontsize=10)
        axes.legend(fontsize=7)
        figure.savefig(FOLDER / f"{environment}-{robot}.png", dpi=130)
        plt.close(figure)
    (FOLDER / "curves.md").write_text("\n".join(lines) + "\n" + REMARK)
    print("\n".join(lines))


if __name__ == "__main__":
    main()
