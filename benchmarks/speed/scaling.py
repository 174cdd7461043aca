"""Weak scaling over the GPUs of one host: the same work on each of 1, 2, 4, ... GPUs, against one GPU of that machine.

    python -m benchmarks.speed.scaling --gpus 1 2 4 [--cases made_60 birch_pictures learner] [--seconds 8] [--rows FILE]
    python -m benchmarks.speed.scaling --gpus 1 2 --cases learner --ways processes graphs together --kernels DIR

| case | a GPU's share |
|---|---|
| `made_60` | simulator alone: 60 made objects pushed about by a hand, all states and a goal, 16,384 worlds |
| `birch_pictures` | simulator alone: the home birch likewise, with 128x128 RGB-D in every control step, 8,192 worlds |
| `learner` | learner with simulator: CookingMeat from pixels, SAC, 2,048 worlds, 1,024 samples of an update |

One process for each GPU. Worlds do not talk to each other, so that the processes of the simulator only begin together;
those of a learner average gradients by one collective program (`ig2mj.learn.several_devices`). A learner of several
GPUs can run in several ways (`--ways`): `processes`; `moving`, the same with XLA's scratch memory wherever there is
room, which `ig2mj train` on several devices keeps in place (`ig2mj.process.keep_scratch_in_place`); `graphs`, as
`processes` with the exchange of gradients inside XLA's CUDA graphs; `together`, one process with all GPUs. `--kernels`
adds `apart`: one GPU, on which stepping and learning are two programs as they are on several. Rows of several GPUs and
of `apart` report the shares of both, and the mean time that a process waits for the slowest one's worlds. All processes
are prepared at the same time and measured one after the other. A speed is all the work divided by the slowest process's
time. Every row counts worlds that overflowed or became non-finite; a row with any is invalid.
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import socket
import sys
import time
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from benchmarks.harness import results
from benchmarks.harness.paths import WORK, module
from benchmarks.harness.waiting import Process, end_all
from ig2mj.process.settings import SCRATCH_IN_PLACE

PROFILE_SECONDS = 60.0
"""That listing a learner's kernels may take."""

SLACK = 4.0
"""Seconds beyond `seconds` that a measurement may take: whole calls are counted, two at least."""

Case = Literal["made_60", "birch_pictures", "learner"]

Way = Literal["processes", "moving", "graphs", "together"]

GRAPHS = "--xla_gpu_enable_command_buffer=+COLLECTIVES"
"""XLA leaves collectives out of its CUDA graphs, which then end before each and begin again after it."""

PROFILED = "--xla_enable_command_buffers_during_profiling=true"
"""Without it XLA launches each kernel by itself while a profiler looks on, which is another program."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    gpus: tuple[int, ...] = (1, 2)
    """Numbers of GPUs; the others are compared with the first, which should be 1."""
    cases: tuple[Case, ...] = ("made_60", "birch_pictures", "learner")
    ways: tuple[Way, ...] = ("processes",)
    """Of a learner on several GPUs; see above."""
    seconds: float = 8.0
    """Of a measurement, about."""
    limit: float = 330.0
    """Seconds for everything; rows are kept as they come, and what there was no time for says so."""
    rows: pathlib.Path | None = None
    """Rows are added to this file, as JSON lines."""
    logs: pathlib.Path = WORK / "scaling"
    """Folder for what the processes say on standard error."""
    kernels: pathlib.Path | None = None
    """Folder for `learner-<GPUs>-<way>-<process>.json`: what ran on a process's first GPU while a learner learned from
    one rollout ten times, after all measurements (`learner_kernels.py` puts them side by side)."""
    profiles: pathlib.Path | None = None
    """Folder with `<home>/engine_profile.json`, for the simulator."""
    cpu: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Small shares on CPU devices, to try the benchmark itself."""


@dataclasses.dataclass
class Group:
    """Processes of one case: for a learner of so many GPUs, else the most that are asked for.

    `way`: of a learner whose worlds and learning are two programs; "" where they are one, and for the simulator.
    """

    case: str
    processes: list[Process]
    numbers: tuple[int, ...]
    way: str = ""

    def chosen(self, number: int) -> list[Process]:
        """The processes that so many GPUs are at work with."""
        return self.processes if self.case == "learner" else self.processes[:number]


def settings_of(case: str, args: Args) -> tuple[str, dict[str, Any]]:
    """The worker's two words."""
    if case == "learner":
        small = {"env": "CookingMeat", "obs": "rgbd", "engine": "warp", "pool_size": 64}
        if args.cpu:
            return case, {
                **small,
                "obs": "state",
                "worlds": 2,
                "batch": 32,
                "capacity": 64,
                "pool_size": 2,
                "learnt": 1,
            }
        return case, {**small, "worlds": 2048, "batch": 1024, "capacity": 204_800, "learnt": 50}
    pictures = case == "birch_pictures"
    home, worlds, steps = ("birch", 8192, 8) if pictures else (str(WORK / "made_60"), 16384, 15)
    if args.cpu:
        worlds, steps = 2, 2
    common = {"home": home, "worlds": worlds, "steps": steps, "pictures": pictures}
    return "simulator", {**common, "profiles": str(args.profiles) if args.profiles else None}


def start(case: str, count: int, args: Args, way: str = "") -> list[Process]:
    """The processes of a group, each with a GPU of its own; `together`: one with all of them."""
    word, settings = settings_of(case, args)
    together = way == "together"
    flags = os.environ.get("XLA_FLAGS", "").split()
    flags += [GRAPHS] if way == "graphs" else []
    flags += [f"--{SCRATCH_IN_PLACE}=false"] if way == "moving" else []
    flags += [PROFILED] if args.kernels is not None and word == "learner" and not args.cpu else []
    flags += [f"--xla_force_host_platform_device_count={count}"] if together and args.cpu else []
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    found = []
    for k in range(1 if together else count):
        environment = {
            "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
            "XLA_FLAGS": " ".join(flags),
            "CUDA_VISIBLE_DEVICES": ",".join(map(str, range(count))) if together else str(k),
            "PYTHONFAULTHANDLER": "1",
        }
        if args.cpu:
            environment["JAX_PLATFORMS"] = "cpu"
        if word == "learner" and count > 1 and not together:
            environment["JAX_COORDINATOR_ADDRESS"] = f"127.0.0.1:{port}"
            environment["JAX_NUM_PROCESSES"], environment["JAX_PROCESS_ID"] = str(count), str(k)
        more = {"apart": way == "apart", "several": word == "learner" and count > 1}
        words = [*module("speed.scaling_worker"), word, json.dumps({**settings, **more})]
        found.append(Process(words, args.logs / f"{name_of(case, count, way)}-{k}.log", environment))
    return found


def name_of(case: str, gpus: int, way: str) -> str:
    """Of a group's files."""
    return f"{case}-{gpus}-{way}" if way else f"{case}-{gpus}"


def ways_of(gpus: int, args: Args) -> tuple[str, ...]:
    """How a learner is to run on so many GPUs."""
    if gpus > 1:
        return args.ways
    return ("", "apart") if args.kernels is not None else ("",)


def groups(args: Args) -> list[Group]:
    """All processes of all cases."""
    made = []
    for case in args.cases:
        if case == "learner":
            made += [Group(case, start(case, n, args, way), (n,), way) for n in args.gpus for way in ways_of(n, args)]
        else:
            made.append(Group(case, start(case, max(args.gpus), args), args.gpus))
    return made


def measure(group: Group, number: int, args: Args, until: float) -> dict[str, Any]:
    """One row: a group's processes of `number` GPUs at the same time. `until`: then it is given up."""
    chosen = group.chosen(number)
    row: dict[str, Any] = {"case": group.case, "gpus": number, "of": args.gpus[0]}
    row |= {"way": group.way} if group.way else {}
    late = [p for p in chosen if p.ready is None]
    if late:
        return {**row, "counts": False, "error": f"not ready, {late[0].trouble()}"}
    if time.monotonic() > until:
        return {**row, "counts": False, "error": "no time was left"}
    for process in chosen:
        process.tell({"seconds": args.seconds})
    done = [process.hear("DONE", until) for process in chosen]
    answers = [d for d in done if d is not None]
    if len(answers) < len(chosen):
        silent = next(p for p, d in zip(chosen, done, strict=True) if d is None)
        return {**row, "counts": False, "error": f"no answer, {silent.trouble()}"}
    seconds = max(d["seconds"] for d in answers)
    troubles = {name: sum(d[name] for d in answers) for name in ("overflow", "non_finite")}
    row |= {
        "worlds": number * settings_of(group.case, args)[1]["worlds"],
        "steps_per_s": round(sum(d["steps"] for d in answers) / seconds, 1),
        "seconds": round(seconds, 2),
        "fastest_over_slowest": round(min(d["seconds"] for d in answers) / seconds, 3),
        **troubles,
        "counts": not any(troubles.values()) and all(d.get("finite", True) for d in answers),
        **(chosen[0].ready or {}),
    }
    if "updates" in answers[0]:
        row["updates_per_s"] = round(answers[0]["updates"] / seconds, 2)
    if "graphs_captured" in answers[0]:
        row["graphs_captured"] = sum(d["graphs_captured"] for d in answers)
        row["moves"] = answers[0].get("moves", [])
    if "worlds_each" in answers[0]:
        each = np.array([d["worlds_each"] for d in answers])  # of processes, iterations
        own, last, per = each.mean(0).sum(), each.max(0).sum(), 1e3 / answers[0]["updates"]
        row["worlds_ms_per_update"] = round(per * own, 3)
        row["waiting_ms_per_update"] = round(per * (last - own), 3)
        row["learning_ms_per_update"] = round(per * (seconds - last), 3)
    return row


def list_kernels(group: Group, folder: pathlib.Path, until: float) -> None:
    """A learner learns some more, and its processes write what runs on their GPUs."""
    name = name_of(group.case, group.numbers[0], group.way)
    for k, process in enumerate(group.processes):
        process.tell({"kernels": str(folder.resolve() / f"{name}-{k}.json")})
    for k, process in enumerate(group.processes):
        if process.hear("DONE", until) is None:
            print(f"no kernels of {name}, process {k}: {process.trouble()}", file=sys.stderr)


def others(group: Group) -> list[Process]:
    """The processes after the first that can be measured alone: those of a simulator."""
    return group.processes[1:] if 1 in group.numbers and len(group.numbers) > 1 else []


def measure_group(group: Group, args: Args, until: float, alone: dict[int, float]) -> None:
    """All rows of a group: each number of GPUs, and each further GPU alone, since those of a host are not all alike.

    Args:
      alone: of the group's case, the speed of each GPU by itself, as far as it is known; what is found is added.
    """

    def one(chosen: Group, number: int, **more: Any) -> dict[str, Any]:
        row = measure(chosen, number, args, min(until, time.monotonic() + 5 * args.seconds + 20.0)) | more
        if number == args.gpus[0] and row["counts"] and chosen.way in ("", args.ways[0]):
            alone[more.get("gpu", 0)] = row["steps_per_s"] / number
        if "steps_per_s" in row and "gpu" not in row:
            if 0 in alone:
                row["weak_scaling"] = round(row["steps_per_s"] / alone[0], 3)
            if number > 1 and set(range(number)) <= alone.keys():
                row["of_these_gpus_alone"] = round(row["steps_per_s"] / sum(alone[k] for k in range(number)), 3)
        results.keep_row({**row, "settings": settings_of(group.case, args)[1]}, args.rows)
        return row

    for number in group.numbers:
        one(group, number)
        if number == 1:
            for k, process in enumerate(others(group), 1):
                one(Group(group.case, [process], (1,)), 1, gpu=k)


def main(args: Args) -> None:
    """Measures; rows go to standard output and to the file."""
    until = time.monotonic() + args.limit
    if "made_60" in args.cases:
        from benchmarks.harness.made_home import write_home

        write_home(WORK / "made_60", 60)
    made = groups(args)
    every = [p for g in made for p in g.processes]
    try:
        # nothing is timed while something else compiles; what is not ready when the rest needs its time is left out
        rounds = sum(len(g.numbers) + len(others(g)) for g in made)
        latest = max(until - rounds * (SLACK + args.seconds), time.monotonic())
        for process in every:
            process.wait_until_ready(latest)
        alone: dict[str, dict[int, float]] = {}
        for group in made:
            measure_group(group, args, until, alone.setdefault(group.case, {}))
        for group in made:
            if args.kernels is not None and group.way and all(p.ready is not None for p in group.processes):
                list_kernels(group, args.kernels, min(until, time.monotonic() + PROFILE_SECONDS))
    finally:
        end_all(every)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
