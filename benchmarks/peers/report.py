"""Rows of `run.py` as a table and a plot: docs/notes/benchmarks.md between its two marks, docs/images/peers.png.

    python -m benchmarks.peers.report [ROWS.jsonl ...]          benchmarks/results/peers/*.jsonl if none are named

Of rows of the same case the last counts. A row that does not count (`counts` is false) is shown with its reason.
"""

from __future__ import annotations

import argparse
import json
import pathlib
from collections.abc import Sequence

from benchmarks.harness.pages import between
from benchmarks.harness.paths import RESULTS, ROOT

PAGE, PLOT = ROOT / "docs" / "notes" / "benchmarks.md", ROOT / "docs" / "images" / "peers.png"
BEGIN, END = "<!-- begin: python -m benchmarks.peers.report -->", "<!-- end of the peers -->"

ENGINES = {"ig2mj": "ig2mj", "mujoco_warp": "MuJoCo Warp", "genesis": "Genesis"}

NAMES = {
    ("ig2mj", "", "physics"): "ig2mj",
    ("mujoco_warp", "", "physics"): "MuJoCo Warp as it comes",
    ("genesis", "hibernation+performance", "physics"): "Genesis, hibernation and performance mode",
    ("genesis", "hibernation", "physics"): "Genesis, hibernation",
    ("genesis", "defaults", "physics"): "Genesis, defaults",
    ("ig2mj", "", "full"): "ig2mj, all states and a goal",
    ("ig2mj", "", "camera"): "ig2mj, those and a 128x128 RGB-D image every control step",
    ("ig2mj", "", "agent"): "ig2mj, those and one image an agent step (three control steps)",
}
"""What is said of an engine, variant and part; in the order of the columns and lines."""

HOMES = ("made_60", "birch", "spruce")

Row = dict


def read(files: Sequence[pathlib.Path]) -> list[Row]:
    """The last row of each case with a speed."""
    rows = [json.loads(line) for file in files for line in file.read_text().splitlines() if line.startswith("{")]
    found = {(*name(row), row["scene"], row["worlds"]): row for row in rows if "control_steps_per_s" in row}
    return sorted(found.values(), key=lambda row: (HOMES.index(row["scene"]), row["worlds"]))


def name(row: Row) -> tuple[str, str, str]:
    """Key of `NAMES`."""
    return row["engine"], row.get("variant", ""), row["what"]


def cell(row: Row | None) -> str:
    """A speed, and why it does not count."""
    if row is None:
        return "-"
    speed = f"{row['control_steps_per_s']:,}"
    return speed if row["counts"] else f"({speed}: {fault(row)})"


def fault(row: Row) -> str:
    """Why a row does not count."""
    if "error" in row:
        return row["error"].splitlines()[0][:60]
    faults = {
        "overflow": row["capacity_overflows"],
        "not finite": row["non_finite"],
        "lost objects": row["lost_object_worlds"] > 1e-3 * row["worlds"],
        "hand touches nothing": row["hand_contact_share"] < 0.1,
    }
    return ", ".join(word for word, found in faults.items() if found) or "unknown"


def table(rows: list[Row], names: list[tuple[str, str, str]]) -> list[str]:
    """Lines by home and worlds, a column for each of these names that has a row."""
    shown = [key for key in names if any(name(row) == key for row in rows)]
    places = list(dict.fromkeys((row["scene"], row["worlds"]) for row in rows if name(row) in shown))
    lines = [
        "| home | worlds | " + " | ".join(NAMES[key] for key in shown) + " |",
        "|---|--:" + "|--:" * len(shown) + "|",
    ]
    for home, worlds in places:
        by = {name(row): row for row in rows if (row["scene"], row["worlds"]) == (home, worlds)}
        label = f"{home} ({next(iter(by.values()))['objects']} objects)"
        lines.append(f"| {label} | {worlds:,} | " + " | ".join(cell(by.get(key)) for key in shown) + " |")
    return lines


def details(rows: list[Row]) -> list[str]:
    """What every row did: contact, motion, losses, memory, time until it was ready."""
    heads = (
        "worlds",
        "ms a control step",
        "spread",
        "hand touches",
        "objects moved",
        "lost: overflow, not finite, objects",
    )
    lines = ["| row | " + " | ".join((*heads, "MB a world", "s until ready")) + " |", "|---|" + "--:|" * 8]
    for row in rows:
        lost = ", ".join(str(row.get(k, "-")) for k in ("capacity_overflows", "non_finite", "lost_object_worlds"))
        label = f" ({row['label']})" if row.get("label") else ""
        lines.append(
            f"| {row['scene']}, {NAMES.get(name(row), ' '.join(name(row)))}{label} | {row['worlds']:,} "
            f"| {row['ms_per_control_step']:.1f} | {row['spread']:.0%} | {row['hand_contact_share']:.0%} "
            f"| {row.get('moved_objects_per_world', float('nan')):.1f} | {lost} "
            f"| {row.get('peak_device_MB_per_world', float('nan')):.2f} | {row['compile_s']:.0f} |"
        )
    return lines


def written(rows: list[Row]) -> str:
    """The text between the marks."""
    physics = [key for key in NAMES if key[2] == "physics"]
    ours = [key for key in NAMES if key[0] == "ig2mj"]
    machines = ", ".join(sorted({row["device"] for row in rows}))
    newest = rows[-1] | next((row for row in rows if row["engine"] == "genesis"), {})
    versions = ", ".join(
        f"{word} {newest[word]}" for word in ("jax", "warp", "mujoco", "genesis", "torch") if word in newest
    )
    text = [f"Control steps a second, physics alone ({machines}; {versions}):", "", *table(rows, physics), ""]
    whole = {(row["scene"], row["worlds"]) for row in rows if row["what"] != "physics"}
    if whole:
        text += ["Ours with what comes on top (agent steps a second are a third of the last column):", ""]
        text += [*table([row for row in rows if (row["scene"], row["worlds"]) in whole], ours), ""]
    engines = [ENGINES[engine] for engine in ENGINES if any(row["engine"] == engine for row in rows)]
    text += [f"![Control steps a second of {', '.join(engines)}](../images/peers.png)", ""]
    text += ["<details><summary>What each row did</summary>", "", *details(rows), "", "</details>"]
    return "\n".join(text)


def draw(rows: list[Row], file: pathlib.Path) -> None:
    """Bars of physics alone by home and worlds, where one of the others was measured; only rows that count."""
    from benchmarks.harness import plots

    physics = [row for row in rows if row["what"] == "physics" and row["counts"]]
    compared = [row for row in physics if row["engine"] != "ig2mj"] or physics
    places = list(dict.fromkeys((row["scene"], row["worlds"]) for row in compared))
    by = {(*name(row), row["scene"], row["worlds"]): row["control_steps_per_s"] for row in physics}
    series = {
        label: [by.get((*key, *place)) for place in places]
        for key, label in NAMES.items()
        if any((*key, *place) in by for place in places)
    }
    groups = [f"{home}\n{worlds:,} worlds" for home, worlds in places]
    plots.grouped_bars(file, "Physics with a pushing hand", groups, series, "control steps a second", log=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", type=pathlib.Path)
    parser.add_argument("--page", type=pathlib.Path, default=PAGE, help="Markdown with the two marks")
    parser.add_argument("--plot", type=pathlib.Path, default=PLOT)
    args = parser.parse_args()
    rows = read(args.rows or sorted((RESULTS / "peers").glob("*.jsonl")))
    if not rows:
        raise SystemExit("error: no rows with a speed; run benchmarks/peers/run.py on a GPU first")
    args.page.write_text(between(args.page.read_text(), BEGIN, END, f"\n{written(rows)}\n"))
    draw(rows, args.plot)


if __name__ == "__main__":
    main()
