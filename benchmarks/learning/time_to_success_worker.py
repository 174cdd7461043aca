"""One run of `benchmarks/learning/time_to_success.py`: `ig2mj train`, which waits between compiling and training.

    python -m benchmarks.learning.time_to_success_worker '{"env": "CookingMeat", "devices": "2", ...}'

Says `READY {...}` once everything is compiled, trains after a line on standard input, and answers `DONE {...}`.
"""

from __future__ import annotations

import json
import pathlib
import sys
from typing import Any

import jax

import ig2mj.learn.train
from ig2mj.cli import train as command


def main() -> None:
    settings = json.loads(sys.argv[1])
    results: list[Any] = []
    original = ig2mj.learn.train.train

    def compiled() -> None:
        print("READY {}", flush=True)
        sys.stdin.readline()

    def gated(*given: Any, **named: Any) -> Any:
        results.append(original(*given, **named, compiled=compiled))
        return results[0]

    ig2mj.learn.train.train = gated  # the command takes it from there when it runs
    settings["out"], settings["set"] = pathlib.Path(settings["out"]), tuple(settings["set"])
    command.run(**settings)
    row, stopped = results[0].row, results[0].stopped
    about = {name: row.get(name) for name in ("seconds", "env_steps", "success", "compile_s")}
    about["device"] = jax.devices()[0].device_kind
    print(f"DONE {json.dumps({**about, 'stopped': stopped})}", flush=True)


if __name__ == "__main__":
    main()
