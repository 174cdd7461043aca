"""Wall time from a shell to the first result of a command, with nothing cached and from warm caches.

    python -m benchmarks.speed.first_result rollout --cache /tmp/new             # one world on a processor
    python -m benchmarks.speed.first_result train evaluate --cache /tmp/new      # on a GPU

Each command runs once in an empty cache folder (cold: JAX's programs, Warp's kernels, what CUDA's driver compiles, and
ig2mj's own files; start states ship with the package), then `--times` times with what the first run left there. A row
has the seconds from the process's start to the first result of each run, and to its end:

- `rollout`: the line of an episode of CookingMeat.
- `train`: the first row of `progress.csv`, which a run of CookingMeat from images in 2,048 worlds writes after its
  second iteration.
- `evaluate`: the end of an evaluation of the shipped policy CookingMeat with as many episodes as worlds (1,000).

`--colds N` repeats the cold run, each time with an empty folder. `--words --set programs=2` adds words to the command.
"""

from __future__ import annotations

import argparse
import pathlib
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence

from benchmarks.harness.paths import environment
from benchmarks.harness.results import keep_row, machine, provenance

COMMANDS = {
    "rollout": ["rollout", "CookingMeat"],
    "train": ["train", "--config", "CookingMeat", "--worlds", "2048", "--minutes", "0.001", "--stop-at-success", "1"],
    "evaluate": ["evaluate", "CookingMeat", "--engine", "warp"],
}

PATIENCE = 300.0
"""Seconds after which a run is ended."""


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="+", choices=COMMANDS)
    parser.add_argument("--cache", type=pathlib.Path, required=True, help="a folder that does not exist yet")
    parser.add_argument("--colds", type=int, default=1, help="cold runs")
    parser.add_argument("--times", type=int, default=3, help="warm runs")
    parser.add_argument("--rows", type=pathlib.Path, help="file for the rows; default: they are printed")
    parser.add_argument("--words", nargs=argparse.REMAINDER, default=[], help="last: further words of each command")
    args = parser.parse_args(argv)
    if args.cache.exists():
        raise SystemExit(f"error: {args.cache} exists, so this would be no cold start; name another folder")
    for name in args.commands:
        cold = []
        for _ in range(args.colds):
            shutil.rmtree(args.cache, ignore_errors=True)
            cold.append(_run(name, args.cache, args.words))
        warm = [_run(name, args.cache, args.words) for _ in range(args.times)]
        row = {
            "benchmark": "first_result",
            "what": name,
            "run": ["ig2mj", *COMMANDS[name], *args.words],
            **provenance(),
            "device": _device(),
        }
        for case, runs in (("cold", cold), ("warm", warm)):
            first, whole = zip(*runs, strict=True)
            row |= {f"{case}_s": _seconds(statistics.median(first)), f"{case}_all_s": [_seconds(s) for s in first]}
            row[f"{case}_process_s"] = _seconds(statistics.median(whole))
        keep_row(row | machine(-1), args.rows)


def _run(name: str, cache: pathlib.Path, words: Sequence[str]) -> tuple[float, float]:
    """Seconds to the first result, and to the end of the process."""
    out = cache / "run"
    shutil.rmtree(out, ignore_errors=True)
    env = environment(IG2MJ_CACHE_DIR=str(cache.resolve()), CUDA_CACHE_PATH=str((cache / "cuda").resolve()))
    for elsewhere in ("JAX_COMPILATION_CACHE_DIR", "WARP_CACHE_PATH"):
        env.pop(elsewhere, None)
    where = ["--out", str(out)] if name == "train" else []
    command = [sys.executable, "-m", "ig2mj", *COMMANDS[name], *where, *words]
    log = pathlib.Path(f"{cache}.log")
    began = time.monotonic()
    with log.open("w") as said:
        process = subprocess.Popen(command, env=env, stdout=said, stderr=said)
        first = None
        while process.poll() is None:
            now = time.monotonic() - began
            if first is None and name == "train" and (out / "progress.csv").exists():
                first = now
            if now > PATIENCE:
                process.kill()
            time.sleep(0.01)
    whole = time.monotonic() - began
    if process.returncode:
        raise SystemExit(f"error: {' '.join(command)} ended with {process.returncode}:\n{log.read_text()[-2000:]}")
    return first if first is not None else whole, whole


def _device() -> str | None:
    """The GPU's name; None: there is none."""
    if shutil.which("nvidia-smi") is None:
        return None
    query = ["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"]
    return subprocess.run(query, capture_output=True, text=True).stdout.strip().split("\n")[0] or None


def _seconds(value: float) -> float:
    return round(value, 2)


if __name__ == "__main__":
    main()
