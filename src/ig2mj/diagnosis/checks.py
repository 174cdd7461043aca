"""What this machine can run: a list of checks, each with the one line that fixes what is missing.

`diagnose()` is what `ig2mj doctor` prints. Everything that may hang or crash (drivers, OpenGL) is tried in a process
of its own.
"""

from __future__ import annotations

import concurrent.futures
import dataclasses
import functools
import importlib.metadata
import json
import os
import pathlib
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable
from typing import Any

from packaging.requirements import Requirement

from ig2mj.install_hint import pip_install, pip_install_extra, requirements
from ig2mj.process import cache_folder
from ig2mj.process.settings import GL_INSTALL_HINT

#: Longest that one probe may take. Importing JAX with CUDA on a cold disk takes about half a minute.
PROBE_TIMEOUT_S = 120.0
#: Oldest NVIDIA driver series that runs CUDA 13.
CUDA13_DRIVER = 580


@dataclasses.dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Attributes:
      group: heading it stands under. name: what was looked at. found: what there is, or what is wrong with it.
      ok: usable. required: ig2mj does not run without it. fix: the line that puts it right; '' where ok or where
        there is nothing to be done.
    """

    group: str
    name: str
    ok: bool
    found: str
    required: bool = False
    fix: str = ""


def diagnose(progress: Callable[[str], None] = lambda text: None) -> list[Check]:
    """Checks everything. `progress` is called with what is being tried. Takes seconds, the first time a minute."""
    from ig2mj.viewer.offscreen import BACKENDS, probe

    tasks: dict[str, Callable[[], Any]] = {
        "MuJoCo": lambda: run_probe("mujoco"),
        "JAX": lambda: run_probe("jax"),
        "Warp": lambda: run_probe("warp"),
        **{f"rendering with {name}": functools.partial(probe, name) for name in BACKENDS},
    }
    with concurrent.futures.ThreadPoolExecutor(max_workers=len(tasks)) as pool:
        waiting = {pool.submit(task): name for name, task in tasks.items()}
        found: dict[str, Any] = {}
        progress(f"trying {', '.join(waiting.values())}")
        for done in concurrent.futures.as_completed(list(waiting)):
            found[waiting.pop(done)] = done.result()
            progress(f"trying {', '.join(waiting.values())}")
    mujoco, jax, warp, *drawn = (found[name] for name in tasks)
    nvidia = nvidia_driver()
    return [
        *machine_checks(nvidia),
        *package_checks(requirements()),
        mujoco_check(mujoco),
        *accelerator_checks(jax, warp, nvidia),
        *picture_checks(dict(zip(BACKENDS, drawn, strict=True))),
        *tool_checks(),
        *cache_checks(warp),
    ]


def healthy(checks: Iterable[Check]) -> bool:
    """Whether everything that ig2mj cannot do without is there."""
    return all(c.ok for c in checks if c.required)


def run_probe(name: str, timeout_s: float = PROBE_TIMEOUT_S) -> dict[str, Any]:
    """Runs a probe of `diagnosis_probes` in a fresh process; its result, or {"error": one line}."""
    command = [sys.executable, "-m", "ig2mj.diagnosis.probes", name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)
    except subprocess.TimeoutExpired:
        return {"error": f"gave no answer within {timeout_s:.0f} s"}
    if done.returncode < 0:
        return {"error": f"was killed by signal {-done.returncode}"}
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    if done.returncode > 0:
        return {"error": lines[-1] if lines else f"failed with status {done.returncode}"}
    return json.loads(done.stdout.splitlines()[-1])


def machine_checks(nvidia: tuple[str, int] | None) -> list[Check]:
    """Python, processor, memory, graphics card, display."""
    ok = sys.version_info >= (3, 11)
    checks = [
        Check("machine", "Python", ok, platform.python_version(), True, "" if ok else "install Python 3.11 or newer"),
        Check("machine", "system", True, f"{platform.platform()}, {os.cpu_count()} cores{_memory()}"),
        Check("machine", "NVIDIA GPU", nvidia is not None, f"{nvidia[0]}, driver {nvidia[1]}" if nvidia else "none"),
    ]
    display = next((f"{v}={os.environ[v]}" for v in ("WAYLAND_DISPLAY", "DISPLAY") if os.environ.get(v)), None)
    if sys.platform in ("darwin", "win32"):
        display = sys.platform
    fix = "" if display else "`ig2mj view SCENE --image out.png` needs no display; for the viewer set DISPLAY"
    return [*checks, Check("machine", "display", display is not None, display or "none", fix=fix)]


def package_checks(requested: Iterable[tuple[Requirement, str | None]]) -> list[Check]:
    """Versions of required packages, and of each extra's packages, against what ig2mj asks for.

    `requested` as `ig2mj.install_hint.requirements` gives it.
    """
    base: list[Requirement] = []
    extras: dict[str, list[Requirement]] = {}
    for requirement, extra in requested:
        if extra is None:
            base.append(requirement)
        elif requirement.name != "ig2mj":  # an extra made of other extras
            extras.setdefault(extra, []).append(requirement)
    checks = []
    for requirement in base:
        found, ok = _installed(requirement)
        fix = "" if ok else pip_install(str(requirement))
        checks.append(Check("packages", requirement.name, ok, found, True, fix))
    for extra, packages in extras.items():
        if extra.startswith("gpu"):
            continue  # judged by the devices that JAX finds
        lacking = [r.name for r in packages if not _installed(r)[1]]
        found = f"missing or too old: {', '.join(lacking)}" if lacking else ", ".join(r.name for r in packages)
        fix = pip_install_extra(extra) if lacking else ""
        checks.append(Check("packages", f"extra [{extra}]", not lacking, found, fix=fix))
    return checks


def mujoco_check(probe: dict[str, Any]) -> Check:
    """Whether MuJoCo steps."""
    error = probe.get("error")
    found = str(error) if error else f"{probe['version']} steps, with sleeping"
    return Check(
        "engines",
        "MuJoCo",
        not error,
        found,
        True,
        _reinstall("mujoco==3.17.*") if error else "",
    )


def accelerator_checks(jax: dict[str, Any], warp: dict[str, Any], nvidia: tuple[str, int] | None) -> list[Check]:
    """JAX and Warp: the processor is required, CUDA is not."""
    extra = "gpu" if nvidia is None or nvidia[1] >= CUDA13_DRIVER else "gpu-cuda12"
    checks = []
    if "error" in jax:
        checks.append(Check("engines", "JAX", False, jax["error"], True, _reinstall("jax>=0.10,<0.12")))
    else:
        devices = jax["devices"]
        checks.append(Check("engines", "JAX", True, f"{', '.join(devices)}; default {jax['backend']}", True))
        cuda = [d for d in devices if d.startswith(("cuda", "gpu"))]
        fix = pip_install_extra(extra) if nvidia and not cuda else ""
        checks.append(Check("engines", "JAX on CUDA", bool(cuda), ", ".join(cuda) or "no CUDA device", fix=fix))
    if "error" in warp:
        fix = _reinstall("warp-lang==1.18.0")
        checks.append(Check("engines", "Warp", False, warp["error"], True, fix))
    else:
        checks.append(Check("engines", "Warp", True, ", ".join(warp["devices"]), True))
        cuda = warp["cuda"]
        fix = "update the NVIDIA driver" if nvidia and not cuda else ""
        checks.append(Check("engines", "Warp on CUDA", bool(cuda), ", ".join(cuda) or "no CUDA device", fix=fix))
    return checks


def picture_checks(backends: dict[str, str | None]) -> list[Check]:
    """Rendering backends that rendered an image. One that works is enough."""
    any_works = None in backends.values()
    checks = []
    for name, error in backends.items():
        fix = ""
        if error is not None:
            fix = GL_INSTALL_HINT if name != "warp" else _reinstall("warp-lang==1.18.0")
        what = "draws (slow, needs no OpenGL)" if name == "warp" else "draws"
        checks.append(Check("pictures", name, error is None, error or what, fix=fix))
    if not any_works:
        checks.append(Check("pictures", "any", False, "no backend draws", fix=GL_INSTALL_HINT))
    return checks


def tool_checks() -> list[Check]:
    """Programs outside of Python, and the data that must come with the packages."""
    from ig2mj.errors import Ig2mjError
    from ig2mj.knowledge import categories
    from ig2mj.viewer.video import ffmpeg_program

    try:
        found, ok = f"{len(categories())} categories", True
    except Ig2mjError as e:
        found, ok = str(e), False
    fix = "" if ok else _reinstall("bddl==1.0.1")
    checks = [Check("tools", "taxonomy (bddl)", ok, found, True, fix)]
    try:
        found, fix = ffmpeg_program(), ""
    except Ig2mjError:
        found, fix = "none", pip_install_extra("demo")
    return [*checks, Check("tools", "ffmpeg (videos)", not fix, found, fix=fix)]


def cache_checks(warp: dict[str, Any]) -> list[Check]:
    """Cache folders: where, how large, writable."""
    own = str(cache_folder())
    folders = {"ig2mj (conversions)": (own, "IG2MJ_CACHE_DIR")}
    if "cache" in warp:
        folders["Warp (compiled kernels)"] = (warp["cache"], "WARP_CACHE_PATH")
    jax = os.environ.get("JAX_COMPILATION_CACHE_DIR") or str(pathlib.Path(own) / "jax")
    folders["JAX (compiled programs)"] = (jax, "JAX_COMPILATION_CACHE_DIR")
    checks = []
    for name, (folder, variable) in folders.items():
        path = pathlib.Path(folder).expanduser()
        ok = _writable(path)
        found = f"{path}: {_size(path)}" + ("" if ok else ", not writable")
        checks.append(Check("caches", name, ok, found, fix="" if ok else f"export {variable}=<a folder of yours>"))
    return checks


def nvidia_driver() -> tuple[str, int] | None:
    """Name of the first NVIDIA GPU and the series of its driver (580 of 580.65.06), or None."""
    command = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True)
        name, _, version = done.stdout.strip().splitlines()[0].rpartition(",")
        return name.strip(), int(version.strip().split(".")[0])
    except (OSError, subprocess.SubprocessError, ValueError, IndexError):
        return None


def _installed(requirement: Requirement) -> tuple[str, bool]:
    """The installed version, and whether it is one that is asked for."""
    try:
        version = importlib.metadata.version(requirement.name)
    except importlib.metadata.PackageNotFoundError:
        return "not installed", False
    if requirement.specifier.contains(version, prereleases=True):
        return version, True
    return f"{version}, but {requirement.specifier} is needed", False


def _reinstall(what: str) -> str:
    return pip_install(what) + " --force-reinstall"


def _memory() -> str:
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return ""
    return f", {total / 2**30:.0f} GiB"


def _writable(folder: pathlib.Path) -> bool:
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK)


def _size(folder: pathlib.Path) -> str:
    if not folder.is_dir():
        return "empty"
    sizes = [f.stat().st_size for f in folder.rglob("*") if f.is_file()]
    return f"{sum(sizes) / 2**20:.0f} MiB in {len(sizes)} files"
