"""The PPO that docs/guide/learning.md shows learns, on a CPU: a point that must reach a goal."""

from __future__ import annotations

import pathlib
import re
import sys

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "learn"))

from small_envs import PointMass

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_hundred_lines_learn():
    page = (ROOT / "docs" / "guide" / "learning.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^## PPO in a hundred lines.*?```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert len(block.splitlines()) <= 110
    made, count = 'env = ig2mj.make("CookingMeat", worlds=2048, engine="warp")', "iterations, length"
    assert block.count(made) == block.count(count + ", epochs, parts = 20") == 1
    block = block.replace(made, "env = PointMass(128)").replace("parts = 20,", "parts = 120,")
    names = {"PointMass": PointMass, "print": lambda *words: None}
    exec(compile(block, "docs/guide/learning.md", "exec"), names)
    assert float(names["success"]) > 0.85
