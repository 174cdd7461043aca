"""Success against training time of the runs on file, beside the rates that the paper states.

    python -m benchmarks.learning.curves [--write]

Reads `progress.csv` files of `ig2mj train` in benchmarks/results/learning, named
ENVIRONMENT-ROBOT-GRASPING-ALGORITHM-OBSERVATION-SEED.csv, and writes a plot for each environment and robot and a table
(curves.md) there, and with --write the tables of docs/guide/learning.md. A row's success is that of the episodes that
ended since the row before, exploration noise included; in the first seconds only successes have ended, so a run
counts as there once every later row is, too.
"""

from __future__ import annotations

import argparse
import collections
import csv
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.harness.pages import between
from benchmarks.harness.paths import RESULTS, ROOT

PAGE = ROOT / "docs" / "guide" / "learning.md"

BEGIN, END = "<!-- tables: benchmarks/learning/curves.py -->", "<!-- end of tables -->"

FOLDER = RESULTS / "learning"

PAPER = {
    "GraspingBook": (100, 25),
    "SoakingTowel": (100, 25),
    "CleaningStainedShelf": (100, 0),
    "CookingMeat": (100, 0),
    "SlicingFruit": (15, 0),
    "BimanualPickAndPlace": (0, None),
}
"""Success in per cent of the bimanual humanoid with mittens, and of Fetch without them (appendix A.3)."""

LONG = 20
"""Minutes beyond which the axis is a logarithm's: most runs end within ten."""

REMARK = """
Settings below have the names of version 0.1; `ig2mj.learn.settings.RENAMED` says what each is called now.
PointNavigation and Reaching were trained on processors, the others on one H200, from rgbd with another run beside them
on the card ("sac+expert" alone). "Held out": of the mean actions of the last policy, or of drawn ones, on 1,000
start states that training never saw. With DAgger and with "sac+expert" (`--expert`) the scripted expert helps; the
paper's runs had none. The DAgger runs here stopped too early, since success then counted
episodes that the expert had a part in. "dagger_glimpses": three runs side by side on the card, cut off at second 410
of 450; until second 183 success is of
the short episodes that ended first after the expert had left (minute two: 99 and 100 %), and what was played on
held-out states are the policies of minute two. "dagger_glimpses_memory" goes on from the humanoid's last policy with
`recall=1` on one core of a processor for 62 minutes; its held-out episodes were played with drawn actions (`--drawn`).
"dagger_memory_at_once": `recall=1` from the beginning, three runs side by side on the card, cut off at second 260 of
570; "memory_base_free": Fetch's two beside it, from before its base was pinned, as all of Fetch's but those with
"base_pinned" in their names. Of these the book's goes on from the policy that had shipped, for 14 minutes on one core
of a processor; the fruit's from "memory_base_free", with what is reckoned, for 15 minutes on one busy core.
"dagger_reckoned": three runs side by side for 9.5 minutes, with what is reckoned from the beginning; "believed": two
for nine minutes, with pictures as bright as OpenGL's and labels for where the actor takes things to be
(of what had moved by less than 5 cm by mistake for where it lay at first). Both were played with drawn actions, the
towel of "believed" with the likeliest, too; until second 150 success is of the episodes that ended first.
"32_updates" and "48_updates_1024_worlds" ran side by side on an H100 each, cut off at seconds 531 and 401; what was
played of the first is the policy of second 480. "rows_averaged" (the actor that acts is a mean of weights) and the
same with "told_16384" ran side by side on an H100 each, scheduled for 486 s and cut off at seconds 407 and 399.
"remembered": as "rows_averaged", to the end, with labels for what a hand holds as it is remembered; "deeper" beside it
on another H100 with layers of 120,120,120,120. What was played are the policies of seconds 419 and 421, the best ones.
SlicingFruit with `--expert`: the first run was cut off; "48_updates" has `guided=0.4 copied=0.25 reach=30 updates=48`;
"trusted" `guided=0.4 copied=0.4 trust=1 reach=30 updates=48`; "rgbd64" the same with `--pixels 64`, cut off at second
161. In these the peak after the expert's help has ended is one of counting: all worlds then begin alone at one moment,
successes end at once and failures 40 s later. It is repaired in "weak_labels" (`guided=0.4 copied=0.3 copy=1 trust=1
reach=30 updates=48 alpha=0.003 capacity=600000 --pixels 64`, and the repaired scale of rewards), which has learned its
512 start states by heart: 95 % of them, and 64 % of the held-out ones. "4096_states" is the same with `--pool-size
4096 --set net=points shift=0`, cut off at second 252: what it does on held-out states is what it does in training.
"places": `--pixels 128 --rows 80:128 --pool-size 4096 --set net=places shift=0 guess=3 actor=256,256 guided=0.35` and
the rest alike, cut off at second 348. "places_choices": DAgger with the same encoder and 21 choices (`training.sh
humanoid` of 2026-11-23 before `glimpses`), beside another run on the card. Reaching: "quiet" had four hardware threads
each, "busy" two of a host that was at work, so that five minutes held 91,000 or 50,000 steps. Fetch without mittens:
`--pixels 64 --set gamma=0.98 horizon=5 held=8 std=0.1 guided=0.4 copied=0.3 copy=1 trust=1 reach=60 shift=0
net=points`. The towel's expert needs 85 to 98 steps, so that with `reach=60` no episode of "60_steps" ever saw a
success.
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
    """Success on held-out start states in per cent with mean actions; with drawn ones, and that said, where only those
    were played; else nothing."""
    rows = file.with_suffix(".evaluations.jsonl")
    found = [json.loads(line) for line in rows.read_text().splitlines()] if rows.is_file() else []
    found = [row for row in found if row["split"] == "held_out"]
    found.sort(key=lambda row: not row.get("drawn"))
    if not found:
        return ""
    return f"{100 * found[-1]['success_rate']:.1f} %" + (" (drawn)" if found[-1].get("drawn") else "")


def reached(curve: list[tuple[float, float, float]], least: float = GOOD) -> float | None:
    """Seconds after which success never falls below `least` again; None: it ends below."""
    since = None
    for seconds, _, success in curve:
        if success < least:
            since = None
        elif since is None:
            since = seconds
    return since


def tables(files: list[pathlib.Path]) -> str:
    """The tables of docs/guide/learning.md: a row for each activity, robot and grasping.

    It is of the run from pictures, with SAC or DAgger, that was best on held-out states (SAC's, where both were), or
    with most training success where none was evaluated; further seeds with the same settings stand in the same row.
    """
    found: dict[tuple[str, str], dict[str, list[pathlib.Path]]] = collections.defaultdict(
        lambda: collections.defaultdict(list)
    )
    for file in files:
        activity, robot, grasping, algorithm, observation, _ = file.stem.split("-")
        if activity in PAPER and algorithm.startswith(("sac", "dagger")) and observation.startswith("rgbd"):
            found[robot, grasping][activity].append(file)
    parts = []
    for (robot, grasping), activities in sorted(found.items(), key=lambda item: item[0], reverse=True):
        lines = [
            f"{robot}, {grasping}:",
            "",
            "| | help | trained (s) | agent steps | training | held out | the paper |",
        ]
        lines.append("|---|---|--:|--:|--:|--:|--:|")
        for activity in PAPER:
            if activity not in activities:
                continue
            best = max(
                activities[activity],
                key=lambda f: (
                    held_out(f) != "",
                    float(held_out(f).split(" ")[0] or 0),
                    "-sac" in f.stem,
                    read(f)[-1][2],
                ),
            )
            seeds = sorted(FOLDER.glob(best.stem.rsplit("-", 1)[0] + "-*.csv"))
            curves = [read(f) for f in seeds]
            paper = PAPER[activity][0 if robot == "humanoid" else 1]
            row = [
                activity,
                "expert (DAgger)" if "-dagger" in best.stem else "expert" if "expert" in best.stem else "",
                ", ".join(f"{c[-1][0]:.0f}" for c in curves),
                ", ".join(f"{1e6 * c[-1][1]:,.0f}" for c in curves),
                ", ".join(f"{c[-1][2]:.1f} %" for c in curves),
                ", ".join(held_out(f) or "not played" for f in seeds),
                "" if paper is None else f"{paper} %",
            ]
            lines.append("| " + " | ".join(row) + " |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true", help="put the tables into docs/guide/learning.md")
    args = parser.parse_args()
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
        figure, axes = plt.subplots(figsize=(6.4, 3.4 + 0.16 * len(runs)), layout="constrained")
        axes.set_prop_cycle(color=plt.get_cmap("tab20").colors)  # pyright: ignore[reportAttributeAccessIssue]
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
        if axes.get_xlim()[1] > LONG:
            axes.set_xscale("log")
        figure.legend(fontsize=7, loc="outside lower center")
        figure.savefig(FOLDER / f"{environment}-{robot}.png", dpi=130)
        plt.close(figure)
    (FOLDER / "curves.md").write_text("\n".join(lines) + "\n" + REMARK)
    print("\n".join(lines))
    if args.write:
        made = tables(sorted(FOLDER.glob("*.csv")))
        page = between(PAGE.read_text(encoding="utf-8"), BEGIN, END, f"\n\n{made}\n\n")
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
