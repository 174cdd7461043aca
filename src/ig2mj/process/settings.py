"""The functions that make the settings listed in `ig2mj.process`."""

from __future__ import annotations

import contextlib
import functools
import importlib
import logging
import os
import pathlib
from collections.abc import Iterator, Mapping

from ig2mj.errors import EngineError, InputError, MissingDependencyError
from ig2mj.process.compilation import (
    CACHE_VARIABLE,
    MIN_COMPILE_SECONDS,
    cache_folder,
    report_warp_compilation,
    report_xla_compilation,
)
from ig2mj.process.kernel_cache import folder_of_warp, keep_kernels_sound, usable_kernel_folder
from ig2mj.process.program_cache import keep_entries_sound, say_not_kept

GL_INSTALL_HINT = "apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri libosmesa6"

_gl: str | None = None


def prepare_jax() -> pathlib.Path | None:
    """Lets JAX keep compiled programs from one process to the next, and reports long compilations on stderr.

    A folder that the user gave JAX (its option `jax_compilation_cache_dir`, or the variable of that name in capitals)
    stands.

    Returns:
      The folder, or None where there is none that can be written to.
    """
    import jax

    report_xla_compilation()
    keep_entries_sound()
    chosen = getattr(jax.config, "jax_compilation_cache_dir", None)
    if chosen:
        return pathlib.Path(chosen)
    folder = cache_folder() / "jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        say_not_kept(folder, failure.strerror or type(failure).__name__)
        return None
    if not os.access(folder, os.W_OK):
        say_not_kept(folder, "it cannot be written to")
        return None
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", MIN_COMPILE_SECONDS)
    return folder


def run_programs_inline() -> None:
    """Makes JAX run small CPU programs in the calling thread.

    By default it hands them to another thread, which costs more than a step of the states of one world. Has an effect
    only before JAX is first used; does nothing where the user has decided (JAX_CPU_ENABLE_ASYNC_DISPATCH).
    """
    import jax

    if "JAX_CPU_ENABLE_ASYNC_DISPATCH" not in os.environ:
        jax.config.update("jax_cpu_enable_async_dispatch", False)


SCRATCH_IN_PLACE = "xla_gpu_temp_buffer_use_separate_color"
"""XLA's option for scratch memory in a pool of its own."""


def keep_scratch_in_place() -> None:
    """XLA's scratch memory on GPUs gets a pool of its own, where each program finds its own in one place every time.

    Else it lies wherever other programs left room. Where a training's iteration is more than one program, Warp then
    captures CUDA graphs again in most iterations (`ig2mj.engine.warp.patches.graphs`). The pool grows as needed, next
    to the memory that JAX takes at its start (XLA_PYTHON_CLIENT_MEM_FRACTION).

    Has an effect only before JAX is first used. Does nothing where XLA_FLAGS has the option already.
    """
    _tell_xla(SCRATCH_IN_PLACE, "true")


TRITON_GEMM = "xla_gpu_enable_triton_gemm"
"""XLA's option for kernels of its own for products of matrices; it compiles and times dozens for each shape."""


def leave_products_to_cublas() -> None:
    """XLA takes NVIDIA's kernels for products of matrices: a training with images compiles in five sixths of the time,
    and is as fast (`docs/notes/start.md`).

    Has an effect only before JAX is first used. Does nothing where XLA_FLAGS has the option already.
    """
    _tell_xla(TRITON_GEMM, "false")


def _tell_xla(option: str, value: str) -> None:
    flags = os.environ.get("XLA_FLAGS", "")
    if option not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} --{option}={value}".lstrip()


def use_processor_only() -> None:
    """Keeps JAX off the GPU in this process; only before JAX is first used."""
    import jax

    jax.config.update("jax_platforms", "cpu")


def keep_compiled_in(folder: pathlib.Path) -> None:
    """Compiled kernels and programs of this process are kept in this folder; before the first engine is made.

    Raises InputError: it is no folder that can be made and written to.
    """
    folder, fix = folder.expanduser().resolve(), "free some space, or name another folder"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        reason = failure.strerror or type(failure).__name__
        raise InputError(folder, f"cannot be the folder of the cache: {reason}", fix=fix) from None
    if not os.access(folder, os.W_OK):
        raise InputError(folder, "cannot be the folder of the cache: it cannot be written to", fix=fix)
    os.environ[CACHE_VARIABLE] = str(folder)


def name_for_processes(variable: str, word: str, separator: str) -> None:
    """Adds a word to a list in an environment variable, which processes that are started take over."""
    words = [known for known in os.environ.get(variable, "").split(separator) if known]
    if word not in words:
        os.environ[variable] = separator.join([*words, word])


def default_variables(variables: Mapping[str, str]) -> None:
    """Sets environment variables that the user did not set, for processes that are started later."""
    for variable, value in variables.items():
        os.environ.setdefault(variable, value)


def name_opengl_platform() -> None:
    """PyOpenGL is for the platform that this process draws with, EGL where it does not draw yet, if nobody decided."""
    os.environ.setdefault("PYOPENGL_PLATFORM", used_gl() or "egl")


@functools.cache
def prepare_warp() -> None:
    """Warp reports compilation as the rest of ig2mj does, keeps kernels where IG2MJ_CACHE_DIR says, and is repaired."""
    import warp as wp

    from ig2mj.process.warp_repairs import (
        collect_nothing_during_captures,
        find_devices_of_this_process,
        keep_external_streams,
    )

    if wp.config.log_level == wp.LOG_INFO:  # the default: nobody asked for more or for less
        wp.config.log_level = wp.LOG_WARNING
    folder = usable_kernel_folder()
    if folder != folder_of_warp():
        wp.config.kernel_cache_dir = str(folder)
    keep_kernels_sound()
    report_warp_compilation()
    keep_external_streams()
    collect_nothing_during_captures()
    find_devices_of_this_process()


@contextlib.contextmanager
def quiet_warp() -> Iterator[None]:
    """Warp tells of nothing less than warnings inside the block."""
    import warp as wp

    level, wp.config.log_level = wp.config.log_level, max(wp.config.log_level, wp.LOG_WARNING)
    try:
        yield
    finally:
        wp.config.log_level = level


def use_gl(backend: str) -> None:
    """Makes `mujoco.Renderer` draw with this backend, whatever MUJOCO_GL was when MuJoCo was imported.

    Args:
      backend: "egl", "osmesa" or "glfw".

    Raises:
      EngineError: this process already renders with another one. MissingDependencyError: it does not load.
    """
    global _gl
    if _gl == backend:
        return
    if _gl is not None:
        raise EngineError(f"this process already renders with {_gl}; {backend} needs a process of its own")
    from mujoco.rendering.classic import gl_context

    try:
        module = importlib.import_module(f"mujoco.{backend}")
    except (ImportError, AttributeError, OSError) as e:
        raise MissingDependencyError(f"{backend} does not load: {e}; try: {GL_INSTALL_HINT}") from e
    gl_context.GLContext = module.GLContext
    _gl = backend


def used_gl() -> str | None:
    """The backend that this process draws with; None before the first picture."""
    return _gl


@functools.cache
def prepare_mujoco() -> None:
    """MuJoCo's warnings go to the logger "ig2mj.mujoco" and no more to a file MUJOCO_LOG.TXT in the working folder."""
    import mujoco

    mujoco.set_mju_user_warning(logging.getLogger("ig2mj.mujoco").warning)
