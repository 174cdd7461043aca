"""What users import: every package says what is public, and `import ig2mj` has what README uses."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import pkgutil
import subprocess
import sys

import pytest

import ig2mj

PACKAGES = (
    "agents",
    "engine",
    "knowledge",
    "predicates",
    "sampling",
    "scene",
    "simulation",
    "states",
    "viewer",
    "worlds",
)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_lists_its_public_names_and_has_them(name):
    package = importlib.import_module(f"ig2mj.{name}")
    assert package.__doc__
    assert package.__all__ == sorted(package.__all__, key=lambda n: (not n.isupper(), not n[0].isupper(), n))
    assert all(hasattr(package, public) for public in package.__all__)


def test_the_top_has_what_the_readme_uses():
    assert {"Scene", "Simulation", "Worlds", "load_scene"} <= set(ig2mj.__all__)
    assert all(getattr(ig2mj, name) is not None for name in ig2mj.__all__)
    with pytest.raises(AttributeError, match="no attribute 'Simulaton'"):
        _ = ig2mj.Simulaton


@pytest.mark.parametrize("name", ["__version__", "agents.UrdfRobot", "envs.list_envs", "demos.igibson.read_igibson"])
def test_names_resolve_in_an_interpreter_that_imported_nothing_else(name):
    code = f"import ig2mj; assert ig2mj.{name}"
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", code]).returncode == 0


def test_the_version_is_that_of_the_installed_package():
    assert ig2mj.__version__ == importlib.metadata.version("ig2mj")


def test_what_is_listed_is_public():
    assert [name for name in dir(ig2mj) if not name.startswith("__")] == sorted(ig2mj.__all__)


def test_a_variable_that_mujoco_refuses_is_a_user_s_error():
    code = "import ig2mj; ig2mj.load_scene"
    environment = {**os.environ, "MUJOCO_GL": "nonsense"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ig2mj.errors.EngineError: the environment variable MUJOCO_GL is 'nonsense': "), last


def test_importing_ig2mj_loads_neither_jax_nor_mujoco():
    code = "import sys, ig2mj; sys.exit(bool({'jax', 'mujoco', 'warp'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_help_of_a_public_name_says_what_it_is():
    found = [
        importlib.import_module(f"ig2mj.{info.name}") for info in pkgutil.iter_modules(ig2mj.__path__) if info.ispkg
    ]
    told = {}
    for package in (ig2mj, *found):
        for name in getattr(package, "__all__", ()):
            if callable(thing := getattr(package, name)):
                told[f"{package.__name__}.{name}"] = (getattr(thing, "__doc__", "") or "").strip()
    assert len(told) > 100
    assert [name for name, text in told.items() if not text or text.startswith("See the module")] == []


def test_an_unknown_name_lists_what_there_is_or_examples_of_it():
    from ig2mj.errors import UnknownNameError

    few, many = [f"name_{k}" for k in range(3)], [f"name_{k}" for k in range(50)]
    assert str(UnknownNameError("thing", "xyz", few)).endswith("(there is name_0, name_1, name_2)")
    assert str(UnknownNameError("thing", "xyz", many)).endswith("name_4, name_5 and 44 more)")
    assert str(UnknownNameError("thing", "xyz", ())).endswith("(there is none)")
