"""Everything that ig2mj changes in its process as a whole, so that other code there knows what it meets.

Importing ig2mj changes nothing. The functions below are called where the first engine, simulation or picture is made,
or earlier by any caller; a second call does nothing. What the user has decided stands.

`ig2mj.cli.main` (the command, not the library):
  - The variable TF_CPP_MIN_LOG_LEVEL is 2, unless it is set: XLA's warnings are not printed, its errors are.

`prepare_jax` (every engine):
  - JAX's option `jax_compilation_cache_dir`: compiled programs are kept in ig2mj's cache folder, unless it has a value;
    then also `jax_persistent_cache_min_compile_time_secs`, 0: all programs are kept.
  - Entries of that cache are written whole or not at all, and broken ones are removed
    (`ig2mj.process.program_cache`).
  - JAX's monitoring gets two listeners: long compilations are reported on stderr.

`run_programs_inline` (a simulation of one world; batches and environments, unless of another engine than the native):
  - JAX's option `jax_cpu_enable_async_dispatch` is off: small CPU programs run in the calling thread. Not where the
    variable JAX_CPU_ENABLE_ASYNC_DISPATCH is set.

`use_processor_only` (processes that sample rows of pools):
  - JAX's option `jax_platforms` is "cpu".

`keep_scratch_in_place` (`ig2mj train` on several devices):
  - XLA_FLAGS gets XLA's option `xla_gpu_temp_buffer_use_separate_color`, unless it has it.

`leave_products_to_cublas` (`ig2mj train`, `ig2mj evaluate`):
  - XLA_FLAGS gets XLA's option `xla_gpu_enable_triton_gemm`, off, unless it has it.

`prepare_mujoco` (every engine):
  - MuJoCo's user warning: what it warns of goes to the logger "ig2mj.mujoco", not to a file in the working folder.

`prepare_warp` (Warp engines):
  - `warp.config.log_level`: WARNING where it was INFO, and long compilations are reported on stderr instead.
  - `warp.config.kernel_cache_dir`: below IG2MJ_CACHE_DIR, where that is set and Warp's own folder was not chosen;
    a folder of this process where it cannot be written to. Modules are compiled where there is room for them, and
    broken ones again (`ig2mj.process.kernel_cache`).
  - Three repairs of Warp 1.18, of its streams, graph captures and devices (`ig2mj.process.warp_repairs`).
  - Steps of MJX get a contact filter, MuJoCo Warp's callback, which drops what our engines' hands ignore and nothing
    in other models (`ig2mj.engine.warp.ignored_contacts`).

Where engines and their cameras are imported and made, kernels loaded, worlds started and programs traced, and while
Warp captures a graph:
  - Python's cyclic garbage collector is off, and on again afterwards if it was (`ig2mj.process.gc_pause`).

Commands (`ig2mj ...`):
  - The collector's thresholds are `ig2mj.process.gc_pause.SELDOM` where they were Python's own.

While an entry point of ig2mj runs (`ig2mj.process.entry`):
  - JAX's option `jax_enable_x64` is off in this thread, and afterwards what it was.

While MJX is imported by an engine (`ig2mj.process.imports`):
  - Something stands in for trimesh and SciPy's spatial algorithms, and Warp does not note what MJX's kernels depend on.

`use_gl` (the first picture):
  - The class of OpenGL contexts that `mujoco.Renderer` makes. Environment variables are not changed.

Environment variables that are read: IG2MJ_CACHE_DIR (moves ig2mj's cache folder, and with it JAX's and Warp's),
MUJOCO_GL (the backend tried first), IG2MJ_PATCHES and IG2MJ_TRY_KERNELS (which of our functions run in place of MuJoCo
Warp's), IG2MJ_PLUGINS (which plug-ins are used, `ig2mj.plugins`), and those named above. MuJoCo Warp's functions are
not replaced process-wide: what `ig2mj.engine.warp.patches` has in their place runs inside our own engines' programs
only.
"""

from __future__ import annotations

from ig2mj.process.compilation import CACHE_VARIABLE, cache_folder
from ig2mj.process.entry import entry_point
from ig2mj.process.settings import (
    keep_scratch_in_place,
    leave_products_to_cublas,
    prepare_jax,
    prepare_mujoco,
    prepare_warp,
    quiet_warp,
    run_programs_inline,
    use_gl,
    use_processor_only,
    used_gl,
)

__all__ = [
    "CACHE_VARIABLE",
    "cache_folder",
    "entry_point",
    "keep_scratch_in_place",
    "leave_products_to_cublas",
    "prepare_jax",
    "prepare_mujoco",
    "prepare_warp",
    "quiet_warp",
    "run_programs_inline",
    "use_gl",
    "use_processor_only",
    "used_gl",
]
