"""The tables of docs/notes/scale.md, computed from the results on file.

    python -m benchmarks.speed.scale_tables [--write] [--price 3.0] [--inside 300] [--between 25]

Measured: speeds and memory of one H200 (results/throughput, results/environments, results/learning), two GPUs of a host
(results/multi_gpu), weak scaling (results/scaling/rows.jsonl, where `scaling.py` has been run), time to success
(results/scaling/time_to_success.jsonl, `time_to_success.py`), sizes (results/scaling/sizes.json, `scale_sizes.py`). For
more GPUs than were measured a table is a forecast: worlds do not talk to each other, and what an update adds is an
all-reduce of the gradients at the given bandwidths. Forecasts are marked with ~.
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
from typing import Any

from benchmarks.harness.pages import between
from benchmarks.harness.paths import RESULTS, ROOT

PAGE = ROOT / "docs" / "notes" / "scale.md"

BEGIN, END = "<!-- tables: benchmarks/speed/scale_tables.py -->", "<!-- end of tables -->"

GPUS = (1, 8, 64, 1000)

HOST = 8
"""GPUs of a host, in forecasts."""

LATENCY = 20e-6
"""Seconds of an all-reduce for each doubling of the number of GPUs: of the order of NCCL's trees over InfiniBand."""


CARD = "H200"
"""What speeds are of."""


def speeds() -> dict[str, float]:
    """Of one H200, steps a second: control steps of the simulator, agent steps of environments and of the learner."""
    rows = json.loads((RESULTS / "throughput" / "result.json").read_text())["rows"]

    def best(scene: str, what: str) -> float:
        good = [r for r in rows if (r["scene"], r["what"], r["case"]) == (scene, what, "disturbed") and r["counts"]]
        return max(r["control_steps_per_s"] for r in good)

    found = {"made_60": best("made_60", "full"), "birch_pictures": best("birch", "camera")}
    for row in lines(RESULTS / "environments" / "h200.jsonl"):
        name = "environment_pictures" if row["observations"] else "environment"
        found[name] = max(found.get(name, 0.0), row["agent_steps_per_s"])
    share = 1.0
    for row in runs(RESULTS / "scaling" / "rows.jsonl"):  # the newest of a GPU at work alone
        if row["gpus"] == 1 and "gpu" not in row and CARD in row["device"]:
            found[row["case"]] = row["steps_per_s"]
            found["updates"] = row.get("updates_per_s", found.get("updates"))
        if row["gpus"] == 2 and row["case"] == "learner":  # of whichever card: what sharing costs is much the same
            share = row["weak_scaling"] / 2
    return {**found, "updates_of_two": share * found["updates"]}


def memory() -> list[tuple[str, int, float]]:
    """MB a world: case, worlds, MB."""
    rows = json.loads((RESULTS / "throughput" / "result.json").read_text())["rows"]
    found = []
    for scene, what, title in (
        ("made_60", "full", "60 made objects"),
        ("birch", "full", "birch"),
        ("birch", "camera", "birch with 128x128 RGB-D"),
        ("spruce", "full", "spruce (123 objects)"),
    ):
        good = [r for r in rows if (r["scene"], r["what"], r["case"]) == (scene, what, "disturbed")]
        if good:
            row = max(good, key=lambda r: r["worlds"])
            found.append((title, row["worlds"], row["peak_device_MB_per_world"]))
    newest = {bool(row["observations"]): row for row in lines(RESULTS / "environments" / "h200.jsonl")}
    for pixels, row in newest.items():
        title = f"CookingMeat with a humanoid{', pixels' if pixels else ''}"
        found.append((title, row["worlds"], row["peak_device_MB_per_world"]))
    return found


def runs(file: pathlib.Path) -> list[dict[str, Any]]:
    """Rows of `scaling.py` that count, of learners those in which each GPU has a process and XLA its own options."""
    return [row for row in lines(file) if row.get("counts") and row.get("way", "processes") == "processes"]


def lines(file: pathlib.Path) -> list[dict[str, Any]]:
    """Rows of a file of JSON lines; none where it is not there."""
    return [json.loads(line) for line in file.read_text().splitlines() if line] if file.exists() else []


def scaling() -> dict[str, dict[int, tuple[float, str]]]:
    """Measured weak scaling: case -> GPUs -> (of one, device; where it was measured also the share of the speeds
    that each of these GPUs has alone)."""
    found: dict[str, dict[int, tuple[float, str]]] = {}
    for row in runs(RESULTS / "scaling" / "rows.jsonl"):
        if row.get("weak_scaling") and row.get("of") == 1:
            share = f", {100 * row['of_these_gpus_alone']:.0f} % of each alone" if "of_these_gpus_alone" in row else ""
            found.setdefault(row["case"], {})[row["gpus"]] = (row["weak_scaling"], row["device"] + share)
    two = json.loads((RESULTS / "multi_gpu" / "result.json").read_text())
    found.setdefault("made_60", {}).setdefault(two["devices"], (two["speedup"], two["device"]))
    return found


def solved() -> dict[str, dict[int, dict[str, Any]]]:
    """Trainings until 95 % succeed: task -> GPUs -> the last row."""
    found: dict[str, dict[int, dict[str, Any]]] = {}
    for row in lines(RESULTS / "scaling" / "time_to_success.jsonl"):
        if "seconds" in row:
            found.setdefault(row["task"], {})[row["gpus"]] = row
    return found


def exchange(gpus: int, sizes: dict[str, int], inside: float, between: float) -> float:
    """Seconds of an update's all-reduce. `inside`, `between`: GB/s within a host and between two."""
    if gpus == 1:
        return 0.0
    rate = (inside if gpus <= HOST else between) * 1e9
    return 2 * (gpus - 1) / gpus * sizes["gradient_bytes_per_update"] / rate + 2 * math.log2(gpus) * LATENCY


def update_seconds(gpus: int, one: dict[str, float], sizes: dict[str, int], inside: float, between: float) -> float:
    """Of an update, with its share of the worlds' steps: what one GPU takes, the gradients, and what sharing costs.

    The last is what an update on two GPUs was measured to take beyond one's, at any number of them.
    """
    alone = 1.0 / one["updates"]
    shared = 1.0 / one["updates_of_two"] - alone if gpus > 1 else 0.0
    return alone + shared + exchange(gpus, sizes, inside, between)


def forecast(gpus: int, one: dict[str, float], sizes: dict[str, int], args: argparse.Namespace) -> float:
    """Agent steps a second of the learner: each GPU does what one does, and waits for the others at every update."""
    return gpus * one["learner"] / (one["updates"] * update_seconds(gpus, one, sizes, args.inside, args.between))


def success(row: dict[str, Any]) -> str:
    """A training's time and steps, or how far it came."""
    card = f" ({row['device']})" if "device" in row else ""
    steps = f"{row['seconds']:.0f} s, {amount(row['env_steps'])} steps{card}"
    return steps if row["solved"] else f"{steps}: {100 * (row['success'] or 0.0):.0f} %"


def table(columns: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown, numbers to the right."""
    marks = ["--", *["--:"] * (len(columns) - 1)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [columns, marks, *rows])


def amount(value: float) -> str:
    """Three figures, with a unit of thousands or more."""
    for size, unit in ((1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"


def tables(args: argparse.Namespace) -> str:
    """All tables."""
    one, sizes = speeds(), json.loads((RESULTS / "scaling" / "sizes.json").read_text())
    seen, learner, parts = scaling(), sizes["learner"]["rgbd"], []

    def simulated(case: str, gpus: int) -> str:
        known = seen.get(case, {})
        share = known[max(known)][0] / max(known) if known else 1.0
        return f"{'' if gpus == 1 else '~'}{amount(gpus * one[case] * (share if gpus > 1 else 1.0))}"

    rows = [
        [
            f"{gpus:,}",
            simulated("made_60", gpus),
            simulated("birch_pictures", gpus),
            f"{'' if gpus == 1 else '~'}{amount(forecast(gpus, one, learner, args))}",
            f"{'' if gpus == 1 else '~'}{100 * forecast(gpus, one, learner, args) / (gpus * one['learner']):.0f} %",
        ]
        for gpus in GPUS
    ]
    head = ["H200s", "60 objects, control steps/s", "birch with images, control steps/s"]
    parts += ["### What so many GPUs give", table([*head, "SAC from pixels, agent steps/s", "of ideal"], rows)]
    if seen:
        every = sorted({n for case in seen.values() for n in case if n > 1})
        rows = [
            [case, *(f"{known[n][0]:.2f} ({known[n][1]})" if n in known else "" for n in every)]
            for case, known in seen.items()
        ]
        parts += ["### Weak scaling measured", table(["case", *(f"{n} GPUs" for n in every)], rows)]
    if runs := solved():
        every = sorted({n for of_task in runs.values() for n in of_task})
        rows = [[task, *(success(known[n]) if n in known else "" for n in every)] for task, known in runs.items()]
        head = ["task", *(f"{n} GPU{'s' if n > 1 else ''}" for n in every)]
        parts += ["### Seconds of training until 95 % of the episodes succeed", table(head, rows)]
    rows = []
    for gpus in GPUS:
        rate = 1.0 / update_seconds(gpus, one, learner, args.inside, args.between)
        sent = 0.0 if gpus == 1 else 2 * (gpus - 1) / gpus * learner["gradient_bytes_per_update"] * rate
        rows.append([f"{gpus:,}", amount(rate), f"{amount(sent)}B", f"{amount(sent * gpus)}B"])
    head = ["H200s", "updates/s", "gradients each GPU sends a second", "all of them"]
    parts += ["### Gradients", table(head, rows)]
    named = {"state": "SAC from state", "rgbd": "SAC from pixels"}
    rows = [
        [
            named[obs],
            f"{amount(s['actor_parameters'] + s['critic_parameters'])}",
            f"{amount(s['checkpoint_bytes'])}B",
            f"{amount(s['gradient_bytes_per_update'])}B",
            f"{amount(s['replay_bytes_per_step'])}B",
            f"{amount(1e6 * s['replay_bytes_per_step'])}B",
        ]
        for obs, s in sizes["learner"].items()
    ]
    head = ["learner", "parameters", "checkpoint", "gradients of an update", "replay of a step", "of a million"]
    parts += ["### Sizes of what is learned", table(head, rows)]
    pool, picture = sizes["pool"], sizes["picture"]
    made = one["birch_pictures"] * picture["rgb_and_depth_128_bytes"]
    rows = [
        [f"start state of {pool['home']}, in a file", f"{amount(pool['file_bytes_per_row'])}B", ""],
        ["the same, on the device", f"{amount(pool['memory_bytes_per_row'])}B", ""],
        ["image, 128x128 RGB-D", f"{amount(picture['rgb_and_depth_128_bytes'])}B", f"{amount(made)}B, never stored"],
        ["the same as it is kept, 32x32", f"{amount(picture['kept_32_bytes'])}B",
         f"{amount(one['learner'] * picture['kept_32_bytes'])}B, into the replay buffer"],
    ]  # fmt: skip
    parts += ["### Start states and images", table(["what", "each", "a second on one H200"], rows)]
    rows = [
        [title, f"{worlds:,}", f"{each:.2f} MB", f"{round(0.9 * 141e3 / each):,}"] for title, worlds, each in memory()
    ]
    head = ["case", "worlds measured", "a world", "worlds in 90 % of an H200's 141 GB"]
    parts += ["### Memory", table(head, rows)]
    rows = []
    for title, name in (
        ("random actions, from state", "environment"),
        ("random actions, 128x128 RGB-D", "environment_pictures"),
        ("SAC from pixels", "learner"),
    ):
        hours = 1e9 / one[name] / 3600
        rows.append([title, amount(one[name]), f"{hours:,.1f}", f"{hours * args.price:,.0f}"])
    head = ["CookingMeat on one H200", "agent steps/s", "GPU hours", f"at {args.price:g} an hour"]
    parts += ["### A billion agent steps", table(head, rows)]
    assumed = (
        f"Forecasts (~) assume {args.inside:g} GB/s between a host's {HOST} GPUs, {args.between:g} GB/s between hosts "
        f"and {1e6 * LATENCY:g} us for each doubling of the number of GPUs; none of them is measured. "
        f"The cost of sharing per update is that of the newest measurement on two cards."
    )
    return "\n\n".join([*parts, assumed])


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--write", action="store_true", help="put them into docs/notes/scale.md")
    parser.add_argument("--price", type=float, default=3.0, help="of an hour of a GPU, in your currency")
    parser.add_argument("--inside", type=float, default=300.0, help="GB/s between GPUs of a host")
    parser.add_argument("--between", type=float, default=25.0, help="GB/s between hosts")
    made = tables(args := parser.parse_args())
    print(made)
    if args.write:
        page = between(PAGE.read_text(encoding="utf-8"), BEGIN, END, f"\n\n{made}\n\n")
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
