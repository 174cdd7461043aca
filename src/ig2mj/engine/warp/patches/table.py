"""The groups of patches, and which of them run in this process.

The environment variable `IG2MJ_PATCHES` chooses: `-solver_loop,-broadphase` leaves two groups out, `contacts,gravity`
runs these two alone, `none` runs MuJoCo Warp as it comes, and unset all run. It is read when the first engine is made.
`benchmarks/speed/ablation.py` measures what each group gains; `docs/notes/gpu.md` has the table.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib

from ig2mj.errors import EngineError, UnknownNameError

VARIABLE = "IG2MJ_PATCHES"


@dataclasses.dataclass(frozen=True)
class Group:
    """Patches that are left out together.

    Attributes:
      reason: why it is there, in one line.
      modules: of this package, that nothing else needs.
      repair: it corrects a fault; the others save time or memory.
    """

    reason: str
    modules: tuple[str, ...]
    repair: bool = False

    @property
    def lines(self) -> int:
        """Lines of its modules."""
        folder = pathlib.Path(__file__).parent
        return sum(len((folder / f"{name}.py").read_text(encoding="utf-8").splitlines()) for name in self.modules)


GROUPS = {
    "constraint_forces": Group(
        "constraint forces are zeroed in worlds without constraints", ("constraint_forces",), True
    ),
    "pair_overflow": Group("too many pairs in the first collision pass are flagged", ("collision",), True),
    "contacts": Group("stray contacts are dropped, slanted normals on faces corrected", ("contacts",), True),
    "graphs": Group("empty and moving arrays do not decide which CUDA graph is replayed", ("graphs", "counters"), True),
    "gravity": Group("gravity compensation per (world, body), not per degree of freedom", ("gravity",)),
    "velocity": Group("the velocity stage runs once a step, not twice", ("velocity",)),
    "skipped_stages": Group("island numbering and a second list of awake dofs are skipped", ("skipped_stages",)),
    "sleeping": Group("a thread for each tree decides about sleep, not one for each world", ("sleeping",)),
    "resting": Group("what depends on positions of sleeping bodies alone is not recomputed", ("resting",)),
    "broadphase": Group("only geoms of awake bodies look for partners", ("broadphase",)),
    "branches": Group("convex kernels of all kinds run side by side", ("branches",)),
    "pair_lists": Group("each convex kernel gets a list of its own pairs, sorted by geoms", ("pair_lists",)),
    "phases": Group("depths and several contacts are found by a second convex kernel", ("phases",)),
    "compact_solver": Group("the solver's matrices are computed only as far as dofs are awake", ("compact_solver",)),
    "grid_stride": Group("constraint rows and Hessian by a few threads a world", ("grid_stride",)),
    "solver_loop": Group("later solver iterations of a world in one kernel", ("solver_loop", "line_search")),
    "scratch": Group("temporary arrays of all CUDA graphs share one block of memory", ("scratch",)),
    "contact_nnz": Group("the size of contact rows is counted with arrays (start-up)", ("contact_nnz",)),
}
"""By name. `phases` and `pair_lists` work with and without `branches`."""


@functools.cache
def chosen() -> frozenset[str]:
    """Names of the groups that run in this process.

    Raises:
      UnknownNameError: the variable names a group that does not exist.
      EngineError: it names some groups with a minus sign and others without.
    """
    words = [word.strip() for word in os.environ.get(VARIABLE, "").split(",") if word.strip()]
    if not words or words == ["all"]:
        return frozenset(GROUPS)
    if words == ["none"]:
        return frozenset()
    names = [word.removeprefix("-") for word in words]
    for name in names:
        if name not in GROUPS:
            raise UnknownNameError(f"group of patches ({VARIABLE})", name, GROUPS)
    left_out = [word.startswith("-") for word in words]
    if all(left_out):
        return frozenset(GROUPS).difference(names)
    if any(left_out):
        raise EngineError(f"{VARIABLE} is '{','.join(words)}': write a minus sign before all names, or before none")
    return frozenset(names)


def runs(group: str) -> bool:
    """Whether the patches of a group run in this process, where they fit the MuJoCo Warp that is installed."""
    assert group in GROUPS, group
    return group in chosen()
