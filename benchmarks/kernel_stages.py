"""What the parts of a physics step take on a GPU, from timelines of `throughput.py --kernels 1 --timeline`.

    python benchmarks/kernel_stages.py FILE.csv [FILE.csv ...]

Milliseconds of a physics step by part, with the profiler's own cost, means over the whole steps in a file. Where CUPTI
does not list what runs in the solver's loop, its iterations are too few and the loop's time is all the same right.
"""

from __future__ import annotations

import collections
import itertools
import pathlib
import sys

PARTS = (
    ("_begin_composite", "poses"),
    ("_boxes", "broad phase"),
    ("_count", "convex pairs"),
    ("ccd_kernel_builder", "convex pairs"),
    ("_wake_collision_kernel", "collisions of what woke"),
    ("_keep_larger", "constraint rows"),
    ("_reset_dsu", "islands and forces"),
    ("_compact_dofs_builder", "accelerations without constraints"),
    ("_solve_init_dof", "solver begins"),
    ("set_conditional_if", "solver loop"),
    ("_qfrc_constraint_from_grad", "integration and sleep"),
)
"""The kernel that a part begins with, as its name begins, and the part."""

Launch = tuple[float, str]


def launches(file: pathlib.Path) -> list[Launch]:
    """Start in microseconds, and name, of each launch; streams' names may hold commas, kernels' do not."""
    rows = [line.split(",") for line in file.read_text().splitlines()]
    return sorted((float(row[0]), row[-1]) for row in rows)


def parts(found: list[Launch]) -> tuple[dict[str, float], int, float]:
    """Milliseconds by part, how many whole steps they are the means of, and the solver's iterations in each."""
    total: dict[str, float] = collections.defaultdict(float)
    begins = [i for i, (_, name) in enumerate(found) if name == "_wake"]
    steps = iterations = 0
    for begin, end in itertools.pairwise(begins):
        names = {name for _, name in found[begin:end]}
        if not {"_boxes", "_qfrc_constraint_from_grad"} <= names:
            continue  # between two control steps
        steps += 1
        part, since = "poses", found[begin][0]
        for time, name in found[begin + 1 : end]:
            iterations += name.startswith("set_conditional_if")
            new = next((part for prefix, part in PARTS if name.startswith(prefix)), part)
            order = [p for _, p in PARTS]
            if order.index(new) > order.index(part):
                total[part] += time - since
                part, since = new, time
        total[part] += found[end][0] - since
        iterations -= 1  # the loop's first look at whether anybody is left
    return {name: value / steps / 1e3 for name, value in total.items()}, steps, iterations / max(steps, 1)


def main() -> None:
    for file in map(pathlib.Path, sys.argv[1:]):
        found, steps, iterations = parts(launches(file))
        print(f"{file.name}: {sum(found.values()):.2f} ms, {iterations:.1f} iterations listed, {steps} steps")
        for name, value in found.items():
            print(f"  {value:6.2f}  {name}")


if __name__ == "__main__":
    main()
