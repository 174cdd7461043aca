"""Weak scaling of work in jobs on one and on two Ray nodes of one processor each: rows of `ig2mj sample` and episodes
of `ig2mj demos collect` a second.

    python benchmarks/ray_scaling.py [--rows 40] [--batches 4] [--out benchmarks/results/scaling/ray.json]

The nodes are started on this machine, each held to a processor of its own. Twice the jobs are done on twice the
nodes; a node's first job, in which it loads and compiles, does not count. Where others use the machine's processors
as well, wall time says little (the load average is told); the processor time that a job costs on its node is told
beside it: twice the ratio of both is the most that weak scaling can be. Each run is added to the file. Takes about six
minutes on two processors.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from typing import Any

from results import machine

from ig2mj.cluster.job_runner import Where
from ig2mj.cluster.jobs import Job, JobSet, import_function
from ig2mj.envs.shared_starts import shared_pool
from ig2mj.learn.demo_jobs import collection_jobs
from ig2mj.sampling.conditions import read_conditions
from ig2mj.sampling.many import row_jobs
from ig2mj.scene.scene import load_scene

OUT = pathlib.Path(__file__).parent / "results" / "scaling" / "ray.json"

HOME, OBJECTS = "birch", ("apple", "carving_knife")

CONDITIONS = ("(on_top apple_0 coffee_table_0)", "(on_top carving_knife_0 coffee_table_0)")

TASK, EPISODES = "GraspingBook", 16
"""Demonstrations: the task, and episodes of a job."""


def timed(function: str, arguments: dict[str, Any], shared: Mapping[str, bytes] | None = None) -> bytes:
    """Does a job; when it was begun and ended, what processor time it took, and who did it."""
    began, spent = time.time(), time.process_time()
    import_function(function)(**arguments, **({"shared": shared} if shared else {}))
    about = {"began": began, "ended": time.time(), "processor": time.process_time() - spent, "who": os.getpid()}
    return json.dumps(about).encode()


def sampled_rows(count: int) -> JobSet:
    """Rows of a pool, a job each."""
    return row_jobs(load_scene(HOME, objects=OBJECTS), read_conditions(CONDITIONS), range(count), 0)


def demonstrations(count: int) -> JobSet:
    """Episodes of an expert, `EPISODES` a job."""
    settings = {
        "env": TASK,
        "robot": None,
        "grasping": None,
        "engine": "native",
        "worlds": 4,
        "observations": ["proprioception", "privileged_state"],
        "split": "train",
        "pool_size": 32,
        "noise": 0.1,
        "disturbed": 0.1,
    }
    jobs = [Job(f"job_{n:03d}", p.arguments) for n in range(count) for p in collection_jobs(settings, EPISODES, n)]
    return JobSet("ig2mj.learn.demo_jobs:collect_job", "demonstrations", jobs, shared_pool(TASK, "train", 32))


def node(core: int, *words: str) -> subprocess.Popen:
    """A node that is held to one processor."""
    here = str(pathlib.Path(__file__).resolve().parent)
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": f"{here}:{os.environ.get('PYTHONPATH', '')}"}
    command = ["taskset", "-c", str(core)] if shutil.which("taskset") else []
    command += [sys.executable, "-m", "ray.scripts.scripts", "start", *words, "--num-cpus", "1", "--num-gpus", "0"]
    command += ["--object-store-memory", "100000000", "--disable-usage-stats", "--block"]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet, start_new_session=True)


def measure(address: str, nodes: int, work: JobSet) -> dict[str, float]:
    """Jobs a second, by the wall and by processor time, between the first job of every node and the last of any."""
    jobs = [Job(p.name, {"function": work.function, "arguments": dict(p.arguments)}) for p in work.jobs]
    store, failed = run(
        JobSet("ray_scaling:timed", "jobs", jobs, work.shared, check=work.check), Where(cluster=address)
    )
    assert not failed, failed
    done = [json.loads(store.get(p.name)) for p in jobs]
    ends = {who: [d["ended"] for d in done if d["who"] == who] for who in {d["who"] for d in done}}
    assert len(ends) == nodes, f"{len(ends)} of {nodes} nodes took part"
    begin, end = max(map(min, ends.values())), min(map(max, ends.values()))
    assert end > begin, "too few jobs for so many nodes"
    spent = [max(min(d["ended"], end) - max(d["began"], begin), 0.0) for d in done]
    shares = [s / (d["ended"] - d["began"]) for s, d in zip(spent, done, strict=True)]
    count, busy = sum(shares), sum(spent)
    processor = sum(s * d["processor"] for s, d in zip(shares, done, strict=True))
    return {
        "nodes": nodes,
        "jobs": round(count, 2),
        "pieces_per_second": round(count / (end - begin), 4),
        "processor_seconds_per_piece": round(processor / count, 4),
        "seconds_per_piece": round(busy / count, 4),
        "idle": round(max(1.0 - busy / ((end - begin) * nodes), 0.0), 4),
    }


def compared(one: dict[str, float], two: dict[str, float]) -> dict[str, Any]:
    """Weak scaling of a kind of work."""
    ratio = 2 * one["processor_seconds_per_piece"] / two["processor_seconds_per_piece"]
    wall = two["pieces_per_second"] / one["pieces_per_second"]
    return {"nodes": [one, two], "weak_scaling_by_wall_time": round(wall, 3), "processor_time_ratio": round(ratio, 3)}


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--rows", type=int, default=40, help="rows of one node")
    parser.add_argument("--batches", type=int, default=4, help="jobs of demonstrations of one node")
    parser.add_argument("--port", type=int, default=7443)
    parser.add_argument("--out", type=pathlib.Path, default=OUT)
    args = parser.parse_args()
    here = str(pathlib.Path(__file__).resolve().parent)
    os.environ["PYTHONPATH"] = f"{here}:{os.environ.get('PYTHONPATH', '')}"
    kinds = {"rows": (sampled_rows, args.rows, 4), "demonstrations": (demonstrations, args.batches, 1)}
    address, started = f"127.0.0.1:{args.port}", []
    measured: dict[str, list[dict[str, float]]] = {kind: [] for kind in kinds}
    try:
        for nodes in (1, 2):
            place = ("--address", address) if started else ("--head", "--port", str(args.port))
            started.append(node(nodes - 1, *place, *(() if nodes == 2 else ("--include-dashboard", "false"))))
            time.sleep(20)
            for kind, (work, count, warm_up) in kinds.items():
                measured[kind].append(measure(address, nodes, work(nodes * (count + warm_up))))
                print(json.dumps({"kind": kind, **measured[kind][-1]}), flush=True)
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()
    result = {
        **{kind: compared(*rows) for kind, rows in measured.items()},
        "load_average": os.getloadavg(),
        "machine": machine(-1),
    }
    args.out.parent.mkdir(parents=True, exist_ok=True)
    runs = json.loads(args.out.read_text())["runs"] if args.out.exists() else []
    args.out.write_text(json.dumps({"runs": [*runs, result]}, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(result))


if __name__ == "__main__":
    main()
