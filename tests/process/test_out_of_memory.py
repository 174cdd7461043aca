"""Too little memory ends in one line with the remedy, from Python and from a shell."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from ig2mj.cli import describe_error
from ig2mj.errors import EngineError
from ig2mj.process.entry import entry_point
from ig2mj.process.out_of_memory import MOST, is_out_of_memory, out_of_memory_text

OF_XLA = jax.errors.JaxRuntimeError(
    "RESOURCE_EXHAUSTED: Out of memory while trying to allocate 687194767360 bytes.\n" + 300 * "allocator statistics "
)
OF_WARP = RuntimeError("Failed to allocate 5 bytes on device 'cuda:0'")
OF_SYSTEM = OSError(12, "Cannot allocate memory")
OF_LOADER = ImportError("libgfortran.so.5: failed to map segment from shared object")


@pytest.mark.parametrize("error", [OF_XLA, OF_WARP, OF_SYSTEM, OF_LOADER, MemoryError()])
def test_errors_of_all_allocators_are_known_and_become_one_short_line(error):
    assert is_out_of_memory(error) and not is_out_of_memory(RuntimeError("a shape is wrong"))
    line, status = describe_error(error)
    assert status == 2 and "fewer worlds" in line and "\n" not in line
    assert line == out_of_memory_text(error) and len(line) < MOST + 260


def test_an_entry_point_names_the_remedy_and_leaves_other_errors_alone():
    @entry_point
    def fails(error: Exception) -> None:
        raise error

    with pytest.raises(EngineError, match="fewer worlds") as failure:
        fails(OF_XLA)
    assert failure.value.__cause__ is OF_XLA
    assert is_out_of_memory(failure.value), "who calls the entry point can still tell"
    with pytest.raises(RuntimeError, match="a shape is wrong"):
        fails(RuntimeError("a shape is wrong"))


def test_numpy_names_the_array_that_does_not_fit():
    @entry_point
    def wants() -> np.ndarray:
        return np.empty((1 << 20, 1 << 20, 8))

    with pytest.raises(EngineError, match=r"TiB for an array with shape \(1048576, 1048576, 8\)"):
        wants()
