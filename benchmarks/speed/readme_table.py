"""The table of speeds in README.md, written from the result files: no figure in it is typed by hand.

python -m benchmarks.speed.readme_table             prints the table
python -m benchmarks.speed.readme_table --write     writes it between its marks in README.md
"""

from __future__ import annotations

import json
import sys
from typing import Any

from benchmarks.harness.pages import between
from benchmarks.harness.paths import RESULTS, ROOT

PAGE = ROOT / "README.md"
BEGIN, END = "<!-- begin: python -m benchmarks.speed.readme_table --write -->\n", "<!-- end of the table -->"

CONTROL_STEPS = 3
"""Control steps of 1/30 s in an agent step of 1/10 s."""

SUITE = "`python -m benchmarks.speed.suite readme`"

CARDS = {"NVIDIA H100 80GB HBM3": "H100", "NVIDIA H200": "H200"}

Row = dict[str, Any]


def table() -> str:
    """Both tables, Markdown, each with its commit and command."""
    return (
        _block(_one_core(), "control steps per second of processor time")
        + "\n"
        + _block(_one_gpu(), "control steps/s: median and range of the calls")
    )


def page_with(text: str) -> str:
    """README.md with another table between the marks."""
    return between(PAGE.read_text(encoding="utf-8"), BEGIN, END, text)


def _block(block: tuple[str, list[tuple[str, str]]], unit: str) -> str:
    source, rows = block
    lines = [f"{source}", "", f"| | {unit} |", "|---|--:|"]
    return "\n".join([*lines, *(f"| {what} | {speed} |" for what, speed in rows)]) + "\n"


def _one_core() -> tuple[str, list[tuple[str, str]]]:
    result = json.loads((RESULTS / "idle_a7" / "result.json").read_text(encoding="utf-8"))
    rows = [row for row in result["rows"] if row["objects"] == 60]
    still, robot = (next(row["rates"] for row in rows if row["robot"] is with_robot) for with_robot in (False, True))

    def rate(rates: Row, name: str) -> str:
        return _thousands(rates[name]["steps_per_cpu_s"])

    machine = result["machine"]
    source = (
        f"One core of a processor ({machine['processor']}), commit {machine['ig2mj_commit']}, `{result['command']}`:"
    )
    return source, [
        ("60 objects, a robot stands among them; all states", rate(robot, "ig2mj")),
        ("the same, MuJoCo alone", rate(robot, "mujoco")),
        ("the same, PyBullet, physics alone", rate(robot, "pybullet")),
        ("60 objects, all asleep, no robot: no physics step is taken, states are checked", rate(still, "ig2mj")),
        ("the same, MuJoCo alone; PyBullet", f"{rate(still, 'mujoco')}; {rate(still, 'pybullet')}"),
    ]


def _one_gpu() -> tuple[str, list[tuple[str, str]]]:
    """Rows of one commit, card and protocol, as `speed.suite readme` measures them. What was not measured is empty."""
    rows = [json.loads(line) for line in (RESULTS / "speed" / "rows.jsonl").read_text(encoding="utf-8").splitlines()]
    [(commit, device, protocol)] = {(row["commit"], row["device"], row.get("protocol", SUITE)) for row in rows}

    def speed(scene: str, worlds: int, what: str = "full", engine: str = "ig2mj") -> str:
        asked = {"scene": scene, "worlds": worlds, "what": what, "engine": engine, "counts": True}
        found = [row for row in rows if asked.items() <= row.items()]
        return _median_and_range(found[-1]) if found else ""

    def cooking(*observations: str) -> str:
        asked = {"environment": "CookingMeat", "observations": list(observations)}
        found = [row["agent_steps_per_s"] for row in rows if asked.items() <= row.items()]
        return f"{_thousands(found[-1] * CONTROL_STEPS)} ({_thousands(found[-1])} agent steps)" if found else ""

    source = f"One {CARDS.get(device, device)}, commit {commit}, {protocol}:"
    return source, [
        ("20 objects, 32,768 worlds", speed("made_20", 32768)),
        ("60 objects, 16,384 worlds", speed("made_60", 16384)),
        ("60 objects and a 128x128 RGB-D image in every step, 8,192 worlds", speed("made_60", 8192, "camera")),
        ("120 objects, 16,384 worlds", speed("made_120", 16384)),
        ("the home `birch`, 8,192 worlds", speed("birch", 8192)),
        ("`birch` with an image in every step", speed("birch", 8192, "camera")),
        ("`birch`, physics alone", speed("birch", 8192, "physics")),
        ("`birch`, time with states over time of physics alone, call by call", _states_cost(rows)),
        ("`birch`, physics alone, MuJoCo Warp as it comes", speed("birch", 8192, "physics", "mujoco_warp")),
        ("environment CookingMeat with the humanoid, 4,096 worlds", cooking()),
        ("CookingMeat with an image in every agent step", cooking("rgb", "depth")),
    ]


def _median_and_range(row: Row) -> str:
    """Of the timed calls, each of 30 control steps; without a range in rows that do not have it."""
    median = _thousands(row["control_steps_per_s"])
    ends = row.get("range_of_calls")
    return f"{median} ({_thousands(ends[0])} to {_thousands(ends[1])})" if ends else median


def _states_cost(rows: list[Row]) -> str:
    """How much longer the k-th call takes with states than without, from rows that were measured in turns."""
    found = [row["time_by_call_over"] for row in rows if row.get("time_by_call_over", {}).get("what") == "physics"]
    if not found:
        return ""
    median, low, high = (f"{value:.2f}" for value in (found[-1]["median"], *found[-1]["range"]))
    return f"{median} ({low} to {high})"


def _thousands(rate: float) -> str:
    """Rounded to hundreds."""
    return f"{round(rate, -2):,.0f}"


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        PAGE.write_text(page_with(table()), encoding="utf-8")
    else:
        print(table())
