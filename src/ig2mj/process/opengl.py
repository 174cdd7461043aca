"""Which OpenGL without a display works here. Each backend is tried in a process of its own, since a broken driver may
abort the process that tries it."""

from __future__ import annotations

import contextlib
import functools
import os
import subprocess
import sys
from collections.abc import Iterator

from ig2mj.errors import EngineError, MissingDependencyError
from ig2mj.process.settings import GL_INSTALL_HINT, use_gl, used_gl

GL_BACKENDS = ("egl", "osmesa")
"""In the order in which they are tried."""

PROBE_XML = """<mujoco><visual><headlight ambient="1 1 1"/></visual><worldbody>
<geom type="box" size=".5 .5 .5" rgba="1 0 0 1"/></worldbody></mujoco>"""
"""A red box, for pictures whose only purpose is to show whether drawing works."""

_PROBE = "import sys; from ig2mj.process import opengl; opengl.draw_probe(sys.argv[1])"


def use_opengl() -> str:
    """Makes every `mujoco.Renderer` of this process draw with OpenGL that works without a display.

    Returns:
      The backend: the one that is already in use, else the one that MUJOCO_GL names where it works, else the first of
      `GL_BACKENDS` that does.

    Raises:
      MissingDependencyError: none works here.
    """
    if (used := used_gl()) is not None:
        return used
    requested = os.environ.get("MUJOCO_GL", "").strip().lower()
    for name in sorted(GL_BACKENDS, key=lambda backend: backend != requested):
        if probe_gl(name) is None:
            use_gl(name)
            return name
    raise MissingDependencyError(f"OpenGL without a display does not work on this machine; try: {GL_INSTALL_HINT}")


@contextlib.contextmanager
def images_of(width: int, height: int) -> Iterator[None]:
    """For the block that makes an OpenGL context for images. Raises EngineError: images of this size cannot be made."""
    import mujoco

    try:
        yield
    except mujoco.FatalError as e:
        raise EngineError(f"OpenGL cannot render images of {width}x{height} pixels here: {e}") from None


@functools.cache
def probe_gl(backend: str, timeout_s: float = 120.0) -> str | None:
    """None if an OpenGL backend draws a small picture in a fresh process; else the reason. Remembered."""
    return run_probe(_PROBE, backend, timeout_s)


def run_probe(program: str, backend: str, timeout_s: float) -> str | None:
    """Runs a program that draws with `backend`, its only argument, in a fresh process; None if it exits with 0."""
    environment = os.environ | {"MUJOCO_GL": backend if backend in GL_BACKENDS else "disable"}
    environment.pop("PYOPENGL_PLATFORM", None)
    try:
        done = subprocess.run(
            [sys.executable, "-c", program, backend],
            env=environment,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"did not draw within {timeout_s:.0f} s"
    if done.returncode == 0:
        return None
    if done.returncode < 0:
        return f"was killed by signal {-done.returncode} while drawing"
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return lines[-1] if lines else f"failed with status {done.returncode}"


def draw_probe(backend: str) -> None:
    """What the process of `probe_gl` does; exits with 0 only if the box really is in the picture."""
    import mujoco

    use_gl(backend)
    model = mujoco.MjModel.from_xml_string(PROBE_XML)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = mujoco.Renderer(model, 32, 32)
    renderer.update_scene(data)
    image = renderer.render()
    renderer.close()
    if (fault := fault_of_probe(image[16, 16].tolist())) is not None:
        sys.exit(fault)


def fault_of_probe(middle: list[int]) -> str | None:
    """What is wrong with a picture of the box, by the colour of its middle pixel."""
    red, green, _ = middle
    return None if red > 60 and red > 2 * green else f"drew a wrong picture (middle pixel {middle}, not red)"
