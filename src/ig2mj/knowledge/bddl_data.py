"""Where the data files of the `bddl` package are. The package itself is never imported: that is slow, and it warns."""

from __future__ import annotations

import functools
import importlib.util
import pathlib

from ig2mj.errors import MissingDependencyError
from ig2mj.install_hint import pip_install


@functools.cache
def bddl_folder() -> pathlib.Path:
    """The installed `bddl` package's folder.

    It holds `hierarchy_owned.json` and `activity_definitions/<activity>/problem<n>.bddl`.

    Raises:
      MissingDependencyError: the package is not installed.
    """
    spec = importlib.util.find_spec("bddl")  # of a top-level package: finds it without running it
    if spec is None or not spec.submodule_search_locations:
        raise MissingDependencyError(f"the Python package 'bddl' is not installed ({pip_install('bddl==1.0.1')})")
    return pathlib.Path(next(iter(spec.submodule_search_locations)))
