"""Names that docs write out, such as `ig2mj.demos.record`, resolve after `import ig2mj` and nothing else."""

from __future__ import annotations

import pathlib
import re
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCS = [ROOT / "docs" / folder for folder in (".", "guide", "reference", "design")]
PAGES = [ROOT / "README.md", *(page for folder in DOCS for page in sorted(folder.glob("*.md")))]
NAME = re.compile(r"(?<![\w/.-])ig2mj(?:\.[A-Za-z_]\w*)+")
FILE = re.compile(r"\.(?:py|md|toml|h5|npz|mujoco)$")

ADDED = {"ig2mj.agents.trolley", "ig2mj.tasks.activities.clearing_table"}
"""What docs/design/adding.md adds to a copy of the package."""

RESOLVE = """
import os, sys
import flax, gymnasium, h5py, jax, mujoco, optax, scipy.spatial, warp  # what ig2mj imports, for all that follow

for name in sys.argv[1:]:
    if os.fork() == 0:
        import ig2mj
        found = ig2mj
        try:
            for part in name.split(".")[1:]:
                found = getattr(found, part)
        except BaseException as error:
            print(name, "->", error, flush=True)
        os._exit(0)
    os.wait()
"""


def names() -> list[str]:
    every = {name for page in PAGES for name in NAME.findall(page.read_text(encoding="utf-8"))}
    return sorted(name for name in every - ADDED if not FILE.search(name))


@pytest.mark.slow
def test_each_name_of_the_docs_resolves_in_an_interpreter_of_its_own():
    found = names()
    assert {"ig2mj.make", "ig2mj.agents", "ig2mj.testing.api_test"} <= set(found)
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", RESOLVE, *found], capture_output=True, text=True)
    assert done.returncode == 0 and not done.stdout, done.stdout + done.stderr[-1000:]
