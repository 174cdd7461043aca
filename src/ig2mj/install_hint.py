"""The command line that installs a Python package, or an extra of ig2mj, into the environment that runs."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import pathlib
from typing import TYPE_CHECKING

from ig2mj.errors import MissingDependencyError

if TYPE_CHECKING:
    from packaging.requirements import Requirement

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
"""Where pyproject.toml stands, if this is a checkout of the project."""

PACKAGE_OF_MODULE = {"PIL": "pillow", "collada": "pycollada", "imageio_ffmpeg": "imageio-ffmpeg", "warp": "warp-lang"}
"""Where the name that is imported is not the name that is installed."""

_MODULE_OF_PACKAGE = {package: module for module, package in PACKAGE_OF_MODULE.items()}


def pip_install(what: str) -> str:
    """E.g. `pip install "bddl==1.0.1"`; with uv where the environment has no pip of its own."""
    return f'{_installer()} install "{what}"'


def require_extras(*extras: str) -> None:
    """Checks that the packages of some extras of ig2mj can be imported, before a command does half of its work.

    Raises:
      MissingDependencyError: one cannot; the message has the one command that installs all of the extras.
    """
    missing = [
        requirement.name
        for requirement, extra in requirements()
        if extra in extras and not _is_importable(_MODULE_OF_PACKAGE.get(_plain(requirement.name), requirement.name))
    ]
    if missing:
        raise MissingDependencyError(
            f"the Python package '{missing[0]}' is not installed ({pip_install_extra(','.join(extras))})"
        )


def require_module(module: str) -> None:
    """Checks that a module can be imported, before a command does half of its work.

    Raises:
      MissingDependencyError: it cannot; the message has the command that installs the extra of ig2mj that asks for it.
    """
    if not _is_importable(module):
        raise MissingDependencyError(f"the Python package '{module}' is not installed ({pip_install_module(module)})")


def pip_install_extra(extra: str) -> str:
    """The command that installs an extra of ig2mj (or several: "convert,demo") from where ig2mj itself came from.

    From a checkout that is `pip install -e ".[convert]"`, with the folder's path if it is not the working directory.
    """
    if (CHECKOUT / "pyproject.toml").is_file():
        folder = "." if pathlib.Path.cwd() == CHECKOUT else str(CHECKOUT)
        return f'{_installer()} install -e "{folder}[{extra}]"'
    source = _source()
    return pip_install(f"ig2mj[{extra}] @ {source}" if source else f"ig2mj[{extra}]")


def pip_install_module(module: str) -> str:
    """The command that makes `import module` work: the extra of ig2mj that asks for it, else the package itself."""
    top = module.partition(".")[0]
    name = _plain(PACKAGE_OF_MODULE.get(top, top))
    for requirement, extra in requirements():
        if _plain(requirement.name) == name:
            return pip_install_extra(extra) if extra else pip_install(f"{requirement.name}{requirement.specifier}")
    return pip_install(name)


def requirements() -> list[tuple[Requirement, str | None]]:
    """What ig2mj asks for on this machine, and the extra that asks for it (None: ig2mj itself), as its metadata say."""
    from packaging.requirements import Requirement

    try:
        metadata = importlib.metadata.metadata("ig2mj")
    except importlib.metadata.PackageNotFoundError:
        return []
    extras = metadata.get_all("Provides-Extra") or []
    found: list[tuple[Requirement, str | None]] = []
    for text in metadata.get_all("Requires-Dist") or []:
        requirement = Requirement(text)
        marker = requirement.marker
        if marker is None or marker.evaluate({"extra": ""}):
            found.append((requirement, None))
        else:
            found += [(requirement, extra) for extra in extras if marker.evaluate({"extra": extra})]
    return found


def _is_importable(module: str) -> bool:
    try:
        return importlib.util.find_spec(module.replace("-", "_")) is not None
    except ModuleNotFoundError:
        return False


def _installer() -> str:
    return "pip" if importlib.util.find_spec("pip") is not None else "uv pip"


def _source() -> str:
    """The URL that ig2mj was installed from, as pip recorded it; '' for a package index."""
    try:
        record = importlib.metadata.distribution("ig2mj").read_text("direct_url.json")
    except importlib.metadata.PackageNotFoundError:
        return ""
    if not record:
        return ""
    data = json.loads(record)
    vcs = data.get("vcs_info", {}).get("vcs")
    return f"{vcs}+{data['url']}" if vcs else data["url"]


def _plain(name: str) -> str:
    return name.replace("_", "-").lower()
