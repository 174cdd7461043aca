"""Files and modules that `IG2MJ_PLUGINS` names: imported once, when something asks for plug-ins."""

from __future__ import annotations

import importlib
import importlib.util
import pathlib
import sys
from types import ModuleType

from ig2mj.errors import PluginError
from ig2mj.plugins.entry_points import VARIABLE, switches
from ig2mj.process.settings import name_for_processes

_imported: set[str] = set()


def import_named() -> None:
    """Imports what `IG2MJ_PLUGINS` names and was not imported yet. Raises PluginError."""
    for word in switches()[1]:
        if word not in _imported:
            _imported.add(word)  # before: it may use what asks for plug-ins
            try:
                _import(word)
            except PluginError:
                _imported.discard(word)
                raise


def name_file(file: str) -> None:
    """Adds a file or module to `IG2MJ_PLUGINS`, for this process and those that it starts, and imports it.

    Raises:
      PluginError: it cannot be imported.
    """
    word = str(pathlib.Path(file).absolute()) if file.endswith(".py") else file
    if "," in word:
        raise PluginError(f"plug-in {file}: {VARIABLE} has commas between its words; choose a path without one")
    name_for_processes(VARIABLE, word, ",")
    import_named()


def import_file(file: pathlib.Path) -> ModuleType:
    """A Python file as a module that is named after it, imported once. Its folder is on the path while it is imported.

    Raises:
      whatever its code raises.
    """
    file = file.resolve()
    known = sys.modules.get(file.stem)
    if known is not None and pathlib.Path(getattr(known, "__file__", None) or "").resolve() == file:
        return known
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    if known is None:
        sys.modules[file.stem] = module  # pickles of worker processes name it
    sys.path.insert(0, str(file.parent))
    try:
        spec.loader.exec_module(module)
    except BaseException:
        if sys.modules.get(file.stem) is module:
            del sys.modules[file.stem]
        raise
    finally:
        sys.path.remove(str(file.parent))
    return module


def _import(word: str) -> None:
    expected = "a Python file or module that calls ig2mj.register is expected"
    if word.endswith(".py") and not pathlib.Path(word).is_file():
        raise PluginError(f"plug-in {word}: there is no such file; {expected} ({VARIABLE} names it)")
    try:
        if word.endswith(".py"):
            import_file(pathlib.Path(word))
        else:
            importlib.import_module(word)
    except PluginError as e:
        raise PluginError(f"plug-in {word}: {e}") from e
    except (Exception, SystemExit) as e:
        why = f"{type(e).__name__}: {e}"
        raise PluginError(f"plug-in {word} cannot be imported: {why}; {expected} ({VARIABLE} names it)") from e
