"""Weak scaling over the GPUs of one host: the same work on each of 1, 2, 4, ... GPUs, against one GPU of that machine.

    python benchmarks/scaling.py --gpus 1 2 4 [--cases made_60 birch_pictures learner] [--seconds 8] [--rows FILE]

| case | a GPU's share |
|---|---|
| `made_60` | simulator alone: 60 made objects pushed about by a hand, all states and a goal, 16,384 worlds |
| `birch_pictures` | simulator alone: the home birch likewise, with 128x128 RGB-D in every control step, 8,192 worlds |
| `learner` | learner with simulator: CookingMeat from pixels, SAC, 2,048 worlds, 1,024 samples of an update |

One process for each GPU. Worlds do not talk to each other, so that the processes of the simulator only begin together;
those of a learner average gradients by one collective program (`ig2mj.learn.iteration`). Everything is made ready side
by side, then measured one after the other while the rest waits. A speed is all the work over the slowest process's
time. Every row says how many worlds overflowed or lost their numbers; a row with any does not count.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import pathlib
import socket
import subprocess
import sys
import threading
import time
from typing import Annotated, Any, Literal

import results
import tyro

HERE = pathlib.Path(__file__).resolve().parent
WORK = HERE.parent / "out" / "benchmarks"

Case = Literal["made_60", "birch_pictures", "learner"]


@dataclasses.dataclass
class Args:
    """What to measure."""

    gpus: tuple[int, ...] = (1, 2)
    """Numbers of GPUs; the first of them is what the others are compared with, and should be 1."""
    cases: tuple[Case, ...] = ("made_60", "birch_pictures", "learner")
    seconds: float = 8.0
    """Of a measurement, about."""
    limit: float = 330.0
    """Seconds for everything; what is not ready by then is left out."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""
    logs: pathlib.Path = WORK / "scaling"
    """Folder for what the processes say on standard error."""
    profiles: pathlib.Path | None = None
    """Folder with `<home>/engine_profile.json`, for the simulator."""
    cpu: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Small shares on CPU devices, to try the benchmark itself."""


@dataclasses.dataclass
class Process:
    """A worker, and the lines it says."""

    opened: subprocess.Popen
    log: pathlib.Path
    ready: dict[str, Any] | None = None

    def hear(self, word: str) -> dict[str, Any] | None:
        """Waits for the line that begins with a word; None: the process has ended."""
        assert self.opened.stdout is not None
        for line in self.opened.stdout:
            if line.startswith(word):
                return json.loads(line[len(word) :])
        return None

    def tell(self, seconds: float) -> None:
        """To measure for so long."""
        assert self.opened.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self.opened.stdin.write(json.dumps({"seconds": seconds}) + "\n")
            self.opened.stdin.flush()

    def last_words(self) -> str:
        """The end of what it said on standard error."""
        return " ".join(self.log.read_text(errors="replace").split())[-300:]


@dataclasses.dataclass
class Group:
    """Processes of one case: for a learner as many as GPUs, else the most that are asked for."""

    case: str
    processes: list[Process]
    numbers: tuple[int, ...]


def settings_of(case: str, args: Args) -> tuple[str, dict[str, Any]]:
    """The worker's two words."""
    if case == "learner":
        small = {"env": "CookingMeat", "obs": "rgbd", "engine": "warp", "pool_size": 64}
        if args.cpu:
            return case, {**small, "obs": "state", "worlds": 2, "batch": 32, "capacity": 64, "pool_size": 2}
        return case, {**small, "worlds": 2048, "batch": 1024, "capacity": 204_800}
    pictures = case == "birch_pictures"
    home, worlds, steps = ("birch", 8192, 8) if pictures else (str(WORK / "made_60"), 16384, 15)
    if args.cpu:
        worlds, steps = 2, 2
    common = {"home": home, "worlds": worlds, "steps": steps, "pictures": pictures}
    return "simulator", {**common, "profiles": str(args.profiles) if args.profiles else None}


def start(case: str, count: int, args: Args) -> list[Process]:
    """The processes of a group, each with a GPU of its own."""
    word, settings = settings_of(case, args)
    args.logs.mkdir(parents=True, exist_ok=True)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    found = []
    for k in range(count):
        environment = {**os.environ, "XLA_PYTHON_CLIENT_PREALLOCATE": "false", "CUDA_VISIBLE_DEVICES": str(k)}
        if args.cpu:
            environment["JAX_PLATFORMS"] = "cpu"
        if word == "learner" and count > 1:
            environment["JAX_COORDINATOR_ADDRESS"] = f"127.0.0.1:{port}"
            environment["JAX_NUM_PROCESSES"], environment["JAX_PROCESS_ID"] = str(count), str(k)
        log = args.logs / f"{case}-{count}-{k}.log"
        words = [sys.executable, str(HERE / "scaling_worker.py"), word, json.dumps(settings)]
        with log.open("w") as said:
            opened = subprocess.Popen(
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said, text=True, env=environment
            )
        found.append(Process(opened, log))
    return found


def groups(args: Args) -> list[Group]:
    """All processes of all cases."""
    made = []
    for case in args.cases:
        if case == "learner":
            made += [Group(case, start(case, n, args), (n,)) for n in args.gpus]
        else:
            made.append(Group(case, start(case, max(args.gpus), args), args.gpus))
    return made


def make_ready(made: list[Group], until: float) -> None:
    """Waits until all processes are ready, or the time is over."""

    def wait(process: Process) -> None:
        process.ready = process.hear("READY")

    threads = [threading.Thread(target=wait, args=(p,), daemon=True) for g in made for p in g.processes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(until - time.monotonic(), 0.0))


def measure(group: Group, number: int, args: Args) -> dict[str, Any]:
    """One row: the first `number` processes of a group at the same time."""
    chosen = group.processes[:number]
    row: dict[str, Any] = {"case": group.case, "gpus": number}
    silent = [p for p in chosen if p.ready is None]
    if silent:
        return {**row, "counts": False, "error": f"not ready: {silent[0].last_words()}"}
    for process in chosen:
        process.tell(args.seconds)
    done = [process.hear("DONE") for process in chosen]
    told = [d for d in done if d is not None]
    if len(told) < number:
        dead = next(p for p, d in zip(chosen, done, strict=True) if d is None)
        return {**row, "counts": False, "error": dead.last_words()}
    seconds = max(d["seconds"] for d in told)
    troubles = {name: sum(d[name] for d in told) for name in ("overflow", "non_finite")}
    row |= {
        "worlds": number * settings_of(group.case, args)[1]["worlds"],
        "steps_per_s": round(sum(d["steps"] for d in told) / seconds, 1),
        "seconds": round(seconds, 2),
        "fastest_over_slowest": round(min(d["seconds"] for d in told) / seconds, 3),
        **troubles,
        "counts": not any(troubles.values()) and all(d.get("finite", True) for d in told),
        **(chosen[0].ready or {}),
    }
    if "updates" in told[0]:
        row["updates_per_s"] = round(told[0]["updates"] / seconds, 2)
    return row


def main(args: Args) -> None:
    """Measures; rows go to standard output and to the file."""
    until = time.monotonic() + args.limit
    if "made_60" in args.cases:
        from made_home import write_home

        write_home(WORK / "made_60", 60)
    made = groups(args)
    try:
        make_ready(made, until - 4 * args.seconds)
        alone: dict[str, float] = {}
        for group in made:
            for number in group.numbers:
                row = measure(group, number, args)
                if row.get("steps_per_s"):
                    alone.setdefault(group.case, row["steps_per_s"] / number)
                    row["weak_scaling"] = round(row["steps_per_s"] / alone[group.case], 3)
                row["of"] = args.gpus[0]
                results.keep_row({**row, "settings": settings_of(group.case, args)[1]}, args.rows)
    finally:
        for process in (p for g in made for p in g.processes):
            with contextlib.suppress(BrokenPipeError, AttributeError):
                process.opened.stdin.close()  # pyright: ignore[reportOptionalMemberAccess]
        for process in (p for g in made for p in g.processes):
            try:
                process.opened.wait(20)
            except subprocess.TimeoutExpired:
                process.opened.kill()


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
