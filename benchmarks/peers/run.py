"""Ours, MuJoCo Warp as it comes, and Genesis in the same homes with the same hand: all rows in one command on a GPU.

    python3 benchmarks/peers/run.py --minutes 9 [--genesis-path DIR | --genesis-python PYTHON] [--rows FILE]
    python3 benchmarks/peers/report.py                   table and plot in docs/notes/benchmarks.md from the rows

Every case is a process of its own with its own time limit. Several are made ready (compiled) side by side; while one is
timed none other is timed on the same device. Genesis takes minutes to build; where there is a second GPU it gets that
one to itself, which its rows say. Rows are added to the file as they come; what is in it is not measured again, so the
same command goes on where time was up. `--genesis-path` is a folder of packages (`pack_genesis.sh`), `--genesis-python`
an interpreter that has them; with neither Genesis is left out.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

from benchmarks.harness.made_home import write_home
from benchmarks.harness.paths import RESULTS, environment, module
from benchmarks.harness.paths import WORK as ALL_WORK
from benchmarks.speed import suite as gpu_suite

ROWS = RESULTS / "peers" / "rows.jsonl"
WORK = ALL_WORK / "peers"

OURS = (
    ("birch", 8192, "physics"),
    ("made_60", 4096, "physics"),
    ("spruce", 4096, "physics"),
    ("birch", 4096, "physics"),
    ("birch", 8192, "full"),
    ("birch", 8192, "camera"),
    ("birch", 8192, "agent"),
    ("made_60", 8192, "physics"),
    ("made_60", 16384, "physics"),
    ("spruce", 2048, "physics"),
    ("spruce", 4096, "full"),
    ("made_60", 16384, "full"),
    ("made_60", 8192, "camera"),
    ("made_60", 8192, "agent"),
    ("spruce", 4096, "camera"),
    ("spruce", 4096, "agent"),
)
"""Home, worlds and what is run, the most important first."""

STOCK = (("birch", 8192), ("made_60", 4096), ("spruce", 4096), ("birch", 4096), ("made_60", 8192))
"""Home and worlds of MuJoCo Warp without our kernels; physics alone."""

GENESIS = (
    ("birch", 8192, "hibernation+performance"),
    ("made_60", 4096, "hibernation+performance"),
    ("spruce", 2048, "hibernation+performance"),
    ("birch", 4096, "hibernation+performance"),
    ("spruce", 4096, "hibernation+performance"),
    ("birch", 4096, "hibernation"),
    ("made_60", 4096, "defaults"),
    ("birch", 4096, "defaults"),
)
"""Home, worlds and variant of Genesis."""

LIMIT, GENESIS_LIMIT = 300.0, 480.0
"""Seconds that one case may take, waiting for others included."""


def key(row: dict) -> tuple:
    """What makes a case."""
    return tuple(row.get(word, "") for word in ("engine", "variant", "scene", "worlds", "what"))


def measured(rows: pathlib.Path) -> set[tuple]:
    """The cases that are in the file of rows with a speed."""
    lines = rows.read_text().splitlines() if rows.exists() else []
    return {key(row) for row in map(json.loads, lines) if "control_steps_per_s" in row}


def devices() -> list[str]:
    """Indices of the GPUs that this process may use; [""] where there is none."""
    if (visible := os.environ.get("CUDA_VISIBLE_DEVICES")) is not None:
        return [word for word in visible.split(",") if word] or [""]
    try:
        asked = subprocess.run(["nvidia-smi", "-L"], capture_output=True, text=True, timeout=30).stdout
    except (OSError, subprocess.TimeoutExpired):
        return [""]
    return [str(index) for index in range(asked.count("GPU "))] or [""]


def folders(args: argparse.Namespace) -> dict[str, str]:
    """What each home's name stands for."""
    names = {case[0] for case in (*OURS, *STOCK, *GENESIS)}
    made = {name: str(write_home(args.work / name, int(name[5:]))) for name in names if name.startswith("made_")}
    return {name: made.get(name, name) for name in sorted(names)}


def ours(args: argparse.Namespace, homes: dict[str, str], device: str) -> Iterator[gpu_suite.Job]:
    """Cases of ours and of MuJoCo Warp as it comes, in turn by importance."""
    plan = [("ig2mj", *case) for case in OURS]
    for place, (home, worlds) in enumerate(STOCK):
        plan.insert(2 * place + 1, ("mujoco_warp", home, worlds, "physics"))
    for engine, home, worlds, what in plan:
        count = min(worlds, args.most_worlds or worlds)
        words = (*module("speed.batch"), homes[home], "--worlds", str(count), "--what", what)
        words = (*words, "--engine", engine, *common(args, device))
        job = gpu_suite.Job(f"{engine}-{home}-{count}-{what}", words, LIMIT, on(device))
        if (engine, "", home, count, what) not in args.measured:
            yield job


def genesis(args: argparse.Namespace, device: str, label: str) -> Iterator[gpu_suite.Job]:
    """Cases of Genesis."""
    env = on(device) | ({"PYTHONPATH": args.genesis_path, "MUJOCO_GL": "disable"} if args.genesis_path else {})
    for home, worlds, variant in GENESIS:
        count = min(worlds, args.most_worlds or worlds)
        words = (*module("peers.genesis_run"), str(args.work / "homes" / home), "--worlds", str(count))
        words = (*words, "--variant", variant, "--label", label, *common(args, device))
        words += ("--cpu",) if args.genesis_cpu else ()
        name = f"genesis-{home}-{count}-physics-{variant}"
        job = gpu_suite.Job(name, words, GENESIS_LIMIT, env, args.genesis_python or sys.executable)
        if ("genesis", variant, home, count, "physics") not in args.measured:
            yield job


def common(args: argparse.Namespace, device: str) -> tuple[str, ...]:
    """Words of all cases of a device: while one of them is timed, the others wait."""
    lock = ("--lock", str(args.work / f"lock_{device}"), "--patience", str(args.patience))
    return "--rows", str(args.rows), *lock


def on(device: str) -> dict[str, str]:
    """Environment of a process that runs on a device."""
    return {"CUDA_VISIBLE_DEVICES": device} if device else {}


def export(args: argparse.Namespace, homes: dict[str, str], jobs: list[gpu_suite.Job]) -> None:
    """Writes the homes of these cases of Genesis, side by side; those that are there stay."""
    folders = {pathlib.Path(job.words[1]) for job in jobs}
    started = []
    for folder in sorted(folder for folder in folders if not (folder / "home.json").exists()):
        words = [sys.executable, *module("peers.genesis_export"), str(folder.parent), homes[folder.name]]
        started.append(subprocess.Popen(words, env=environment(JAX_PLATFORMS="cpu")))
    for process in started:
        process.wait()


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=9.0, help="time limit of everything")
    parser.add_argument("--rows", type=pathlib.Path, default=ROWS, help="file of JSON lines")
    parser.add_argument("--work", type=pathlib.Path, default=WORK, help="folder for homes, locks and logs")
    parser.add_argument("--genesis-path", help="folder with Genesis' packages, for this Python")
    parser.add_argument("--genesis-python", help="a Python that has Genesis")
    parser.add_argument("--jobs", type=int, default=0, help="processes of ours at a time; 0: one for four processors")
    parser.add_argument("--genesis-jobs", type=int, default=3, help="Genesis' processes at a time")
    parser.add_argument(
        "--patience", type=float, default=0.0, help="seconds for which what is ready waits for what is being compiled"
    )
    parser.add_argument("--only", nargs="*", default=[], help="only cases whose names contain all of these")
    parser.add_argument("--most-worlds", type=int, default=0, help="no case with more worlds; for a small machine")
    parser.add_argument("--genesis-cpu", action="store_true", help="Genesis on the processor, to try this program")
    args = parser.parse_args()
    args.end = time.monotonic() + 60 * args.minutes
    args.measured = measured(args.rows)
    args.rows.parent.mkdir(parents=True, exist_ok=True)
    args.work.mkdir(parents=True, exist_ok=True)
    return args


def main() -> None:
    args = parsed()
    homes, gpus = folders(args), devices()
    asked: Callable[[gpu_suite.Job], bool] = lambda job: all(word in job.name for word in args.only)  # noqa: E731

    def begin(jobs: list[gpu_suite.Job], at_once: int) -> None:
        runner = gpu_suite.Runner(args.work, args.work / "failures.jsonl", at_once, args.end - time.monotonic())
        runner.run(jobs)

    mine = list(filter(asked, ours(args, homes, gpus[0])))
    places = args.jobs or max(1, len(os.sched_getaffinity(0)) // 4)
    threads = [threading.Thread(target=begin, args=(mine, places))]
    if args.genesis_path or args.genesis_python:
        label = f"on GPU {gpus[-1]}, ours on GPU {gpus[0]}" if len(gpus) > 1 else ""
        theirs = list(filter(asked, genesis(args, gpus[-1], label)))

        def export_and_begin() -> None:
            export(args, homes, theirs)
            begin(theirs, args.genesis_jobs)

        threads.append(threading.Thread(target=export_and_begin))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print(f"{len(measured(args.rows))} cases in {args.rows}")


if __name__ == "__main__":
    main()
