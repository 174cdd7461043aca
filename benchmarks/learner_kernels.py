"""Where an update's time goes on one GPU and on several, from what `scaling.py --kernels DIR` wrote.

    python benchmarks/learner_kernels.py DIR/learner-1-apart-0.json DIR/learner-2-processes-0.json [...] [--longest 20]

Milliseconds of an update by kind of kernel, and what is between kernels; the worlds' steps are not in it. A collective
waits for the other GPUs: at its shortest it took what it takes, the rest is waiting. Then the kernels whose times
differ most between the first file and the others. Kernels run side by side in places, so that kinds may add up to more
than `busy`.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
from typing import Any

import results
from kernel_times import GAP_NAMES, WARP_MARK
from rich.console import Console

KINDS = (
    ("collectives", re.compile("nccl", re.IGNORECASE)),
    ("the worlds (Warp)", re.compile("^" + WARP_MARK)),
    ("copies", re.compile("^Mem(cpy|set)")),
    ("matrices, convolutions", re.compile("gemm|cutlass|cudnn|nvjet|xmma|conv", re.IGNORECASE)),
)
"""Kinds by the names of kernels, the first that fits; all else is XLA's own."""

OTHER = "XLA's other kernels"


def kind_of(name: str) -> str:
    """A kernel's kind."""
    return next((kind for kind, pattern in KINDS if pattern.search(name)), OTHER)


def shares(written: dict[str, Any]) -> dict[str, float]:
    """Milliseconds of an update by part, and launches."""
    per = 1e3 / written["steps"]
    found = {"both": (written["busy"] + written["idle"]) * per}
    found |= {name: written[name] * per for name in ("busy", "idle")}
    for kind in (*(kind for kind, _ in KINDS), OTHER):
        found[kind] = per * sum(k["total"] for name, k in written["kernels"].items() if kind_of(name) == kind)
    collectives = [k for name, k in written["kernels"].items() if kind_of(name) == "collectives"]
    found["of collectives: waiting"] = per * sum(k["total"] - k["times"] * k["least"] for k in collectives)
    for name in GAP_NAMES:
        found[f"idle, {name}"] = per * written["gaps"][name]["total"]
    found["launches"] = sum(k["times"] for k in written["kernels"].values()) / written["steps"]
    return found


def differences(files: list[dict[str, Any]], longest: int) -> list[list[str]]:
    """Kernels whose milliseconds of an update differ most from the first file's, with all files' figures."""
    names = {name for written in files for name in written["kernels"]}

    def each(name: str) -> list[float]:
        return [1e3 * w["kernels"].get(name, {"total": 0.0})["total"] / w["steps"] for w in files]

    by_name = {name: each(name) for name in names}
    order = sorted(names, key=lambda name: -max(abs(v - by_name[name][0]) for v in by_name[name]))
    return [[name[:70], *(f"{v:.4f}" for v in by_name[name])] for name in order[:longest]]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", type=pathlib.Path, nargs="+")
    parser.add_argument("--longest", type=int, default=20, help="kernels to list")
    args = parser.parse_args()
    files = [json.loads(file.read_text()) for file in args.files]
    parts = [shares(written) for written in files]
    columns = ["ms an update", *(file.stem for file in args.files)]
    console = Console(width=140)
    console.print(results.table("an update", columns, [[n, *(f"{p[n]:.3f}" for p in parts)] for n in parts[0]]))
    console.print(results.table("kernels that differ most", columns, differences(files, args.longest)))


if __name__ == "__main__":
    main()
