"""The command line that installs a Python package into the environment that runs."""

from __future__ import annotations

import importlib.metadata
import importlib.util


def pip_install(what: str) -> str:
    """E.g. `pip install "ig2mj[convert]"`; with uv where the environment has no pip of its own."""
    tool = "pip" if importlib.util.find_spec("pip") is not None else "uv pip"
    return f'{tool} install "{what}"'


def pip_install_module(module: str) -> str:
    """The command that makes `import module` work: the extra of ig2mj that asks for it, else the package itself."""
    package = module.partition(".")[0].replace("_", "-").lower()
    try:
        requirements = importlib.metadata.requires("ig2mj") or []
    except importlib.metadata.PackageNotFoundError:
        requirements = []
    for requirement in requirements:
        if requirement.lower().replace("_", "-").startswith(package) and "extra ==" in requirement:
            extra = requirement.split("extra ==")[1].strip(" '\"")
            return pip_install(f"ig2mj[{extra}]")
    return pip_install(package)
