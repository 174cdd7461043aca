"""Weak scaling of work in pieces: rows of `ig2mj sample` a second on one and on two Ray nodes of one processor each.

    python benchmarks/ray_scaling.py [--rows 24] [--out benchmarks/results/scaling/ray.json]

The nodes are started on this machine, each held to a processor of its own. Twice the rows are sampled on twice the
nodes. Where others use the machine's processors as well, wall time says little (the load average is told); the
processor time that a row costs on its node is told beside it: twice the ratio of both is the most that weak scaling
can be. Each run is added to the file.
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

from results import machine

from ig2mj.cluster.pieces import Where, run
from ig2mj.cluster.work import Piece, Work
from ig2mj.sampling.conditions import read_conditions
from ig2mj.sampling.many import row_work
from ig2mj.scene.scene import load_scene

OUT = pathlib.Path(__file__).parent / "results" / "scaling" / "ray.json"

CONDITIONS = ("(on_top apple_0 breakfast_table_0)", "(inside fish_0 fridge_0)")


def timed_row(**arguments: object) -> bytes:
    """A row, and when it was begun and ended, what processor time it took, and who did it."""
    from ig2mj.sampling.many import row_piece

    began, spent = time.time(), time.process_time()
    row_piece(**arguments)  # pyright: ignore[reportArgumentType]
    found = {"began": began, "ended": time.time(), "processor": time.process_time() - spent, "who": os.getpid()}
    return json.dumps(found).encode()


def node(core: int, *words: str) -> subprocess.Popen:
    """A node that is held to one processor."""
    here = str(pathlib.Path(__file__).resolve().parent)
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": f"{here}:{os.environ.get('PYTHONPATH', '')}"}
    command = ["taskset", "-c", str(core)] if shutil.which("taskset") else []
    command += [sys.executable, "-m", "ray.scripts.scripts", "start", *words, "--num-cpus", "1", "--num-gpus", "0"]
    command += ["--object-store-memory", "100000000", "--disable-usage-stats", "--block"]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet, start_new_session=True)


def measure(address: str, nodes: int, rows: int) -> dict[str, float]:
    """Rows a second, by the wall and by processor time. Loading the scene on each node is done before."""
    scene = load_scene("small_home")
    plain = row_work(scene, read_conditions(CONDITIONS), range(nodes * (rows + 4)), 0)
    pieces = [Piece(p.name, p.arguments) for p in plain.pieces]
    work = Work("ray_scaling:timed_row", "rows", pieces, check=plain.check)
    store, failed = run(work, Where(cluster=address))
    assert not failed, failed
    done = sorted((json.loads(store.get(p.name)) for p in pieces), key=lambda d: d["began"])
    first = {who: min(d["ended"] for d in done if d["who"] == who) for who in {d["who"] for d in done}}
    counted = [d for d in done if d["began"] >= max(first.values())]  # every node has loaded the scene
    wall = max(d["ended"] for d in counted) - min(d["began"] for d in counted)
    busy = sum(d["ended"] - d["began"] for d in counted)
    return {
        "nodes": nodes,
        "rows": len(counted),
        "workers": len(first),
        "rows_per_second": round(len(counted) / wall, 4),
        "processor_seconds_per_row": round(sum(d["processor"] for d in counted) / len(counted), 4),
        "idle": round(max(1.0 - busy / (wall * nodes), 0.0), 4),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=24, help="of one node")
    parser.add_argument("--port", type=int, default=7443)
    parser.add_argument("--out", type=pathlib.Path, default=OUT)
    args = parser.parse_args()
    here = str(pathlib.Path(__file__).resolve().parent)
    os.environ["PYTHONPATH"] = f"{here}:{os.environ.get('PYTHONPATH', '')}"
    address, started, rows = f"127.0.0.1:{args.port}", [], []
    try:
        started.append(node(0, "--head", "--port", str(args.port), "--include-dashboard", "false"))
        time.sleep(20)
        rows.append(measure(address, 1, args.rows))
        print(json.dumps(rows[-1]), flush=True)
        started.append(node(1, "--address", address))
        time.sleep(20)
        rows.append(measure(address, 2, args.rows))
        print(json.dumps(rows[-1]), flush=True)
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()
    one, two = rows
    ratio = 2 * one["processor_seconds_per_row"] / two["processor_seconds_per_row"]
    found = {
        "rows": rows,
        "weak_scaling_by_wall_time": round(two["rows_per_second"] / one["rows_per_second"], 3),
        "processor_time_ratio": round(ratio, 3),
        "load_average": os.getloadavg(),
        "machine": machine(-1),
    }
    args.out.parent.mkdir(parents=True, exist_ok=True)
    runs = json.loads(args.out.read_text())["runs"] if args.out.exists() else []
    args.out.write_text(json.dumps({"runs": [*runs, found]}, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(found))


if __name__ == "__main__":
    main()
