"""The table of speeds in README.md, written from the result files: no figure in it is typed by hand.

python benchmarks/readme_speed.py             prints the table
python benchmarks/readme_speed.py --write     writes it between its marks in README.md
"""

from __future__ import annotations

import json
import pathlib
import sys
from typing import Any

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "README.md"
BEGIN, END = "<!-- begin: python benchmarks/readme_speed.py --write -->\n", "<!-- end of the table -->"

CONTROL_STEPS = 3
"""Control steps of 1/30 s in an agent step of 1/10 s."""

Row = dict[str, Any]

SCALING = {"made_60": ("made_60", 16384, "full"), "birch_pictures": ("birch", 8192, "camera")}
"""Cases of `scaling.py` on one GPU: home, worlds and what is run."""


def table() -> str:
    """The whole table, Markdown."""
    lines = ["| | control steps/s |", "|---|--:|"]
    lines += [f"| {what} | {speed} |" for what, speed in (*_one_core(), *_one_gpu(), _two_gpus())]
    return "\n".join(lines) + "\n"


def page_with(text: str) -> str:
    """README.md with another table between the marks."""
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    return before + BEGIN + "\n" + text + "\n" + END + rest.split(END)[1]


def _one_core() -> list[tuple[str, str]]:
    rows = [row for row in _load("idle_a7")["rows"] if row["objects"] == 60]
    still, robot = (next(row["rates"] for row in rows if row["robot"] is with_robot) for with_robot in (False, True))

    def pair(rates: Row) -> str:
        ours, bullet = (_thousands(rates[name]["steps_per_cpu_s"]) for name in ("ig2mj", "pybullet"))
        return f"{ours} (PyBullet: {bullet})"

    return [
        ("**One core**, one world, 60 objects at rest; PyBullet runs physics alone", pair(still)),
        ("the same with a robot that stands still", pair(robot)),
    ]


def _one_gpu() -> list[tuple[str, str]]:
    measured = {(row["scene"], row["worlds"], row["what"]): row for row in _load("throughput")["rows"] if _counts(row)}
    peers = [json.loads(line) for line in (RESULTS / "peers" / "rows.jsonl").read_text().splitlines()]
    ours = {(row["scene"], row["worlds"], row["what"]): row for row in peers if row["engine"] == "ig2mj"}
    alone = {(scene, worlds, what): _scaling(case, 1) for case, (scene, worlds, what) in SCALING.items()}
    known = {**ours, **measured, **alone}  # the newer ones last

    def speed(scene: str, worlds: int, what: str = "full") -> str:
        return _thousands(known[scene, worlds, what]["control_steps_per_s"])

    others = [_physics(peers, engine, "birch", 8192) for engine in ("mujoco_warp", "genesis")]
    cooking, seeing = (_cooking(observations) for observations in ([], ["rgb", "depth"]))
    return [
        ("**One H200**, 20 objects, 32,768 worlds", speed("made_20", 32768)),
        ("60 objects, 16,384 worlds", speed("made_60", 16384)),
        ("60 objects and a 128x128 RGB-D picture in every step, 8,192 worlds", speed("made_60", 8192, "camera")),
        ("120 objects, 16,384 worlds", speed("made_120", 16384)),
        ("the home `birch`, 8,192 worlds", speed("birch", 8192)),
        ("`birch` with a picture in every step", speed("birch", 8192, "camera")),
        (
            "`birch`, physics alone; beside it MuJoCo Warp as it comes, and Genesis",
            f"{_physics(peers, 'ig2mj', 'birch', 8192)} ({others[0]}, {others[1]})",
        ),
        (f"environment CookingMeat with the humanoid, {cooking['worlds']:,} worlds", _agent_steps(cooking)),
        ("CookingMeat with a picture in every agent step", _agent_steps(seeing)),
    ]


def _physics(peers: list[Row], engine: str, scene: str, worlds: int) -> str:
    """The newest row of an engine's physics."""
    asked = {"engine": engine, "scene": scene, "worlds": worlds, "what": "physics", "counts": True}
    return _thousands([row for row in peers if asked.items() <= row.items()][-1]["control_steps_per_s"])


def _two_gpus() -> tuple[str, str]:
    return "**Two H200**, 60 objects, 32,768 worlds", _thousands(_scaling("made_60", 2)["control_steps_per_s"])


def _scaling(case: str, gpus: int) -> Row:
    """The newest row of `scaling.py`, all states included."""
    lines = (RESULTS / "scaling" / "rows.jsonl").read_text().splitlines()
    asked = {"case": case, "gpus": gpus, "counts": True}
    row = [row for row in map(json.loads, lines) if asked.items() <= row.items()][-1]
    return {"control_steps_per_s": row["steps_per_s"]}


def _counts(row: Row) -> bool:
    return row["counts"] and row["case"] == "disturbed" and not row["label"]


def _cooking(observations: list[str]) -> Row:
    """The newest measurement of the environment with these observations."""
    lines = (RESULTS / "environments" / "h200.jsonl").read_text().splitlines()
    return [row for row in map(json.loads, lines) if row["observations"] == observations][-1]


def _agent_steps(row: Row) -> str:
    rate = row["agent_steps_per_s"]
    return f"{_thousands(rate * CONTROL_STEPS)} ({_thousands(rate)} agent steps)"


def _load(name: str) -> Row:
    return json.loads((RESULTS / name / "result.json").read_text(encoding="utf-8"))


def _thousands(rate: float) -> str:
    """Rounded to hundreds."""
    return f"{round(rate, -2):,.0f}"


if __name__ == "__main__":
    if "--write" in sys.argv[1:]:
        PAGE.write_text(page_with(table()), encoding="utf-8")
    else:
        print(table())
