"""What users import: every package says what is public, and `import ig2mj` has what README uses."""

from __future__ import annotations

import importlib
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


def test_importing_ig2mj_loads_neither_jax_nor_mujoco():
    code = "import sys, ig2mj; sys.exit(bool({'jax', 'mujoco', 'warp'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
