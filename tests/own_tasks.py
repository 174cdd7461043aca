"""Files of tasks for tests: an apple of the tiny home that belongs on the floor."""

from __future__ import annotations

import pathlib
import textwrap

APPLE = '''
"""Tasks of a user's."""

import jax.numpy as jnp

import ig2mj


class AppleToFloor(ig2mj.CustomTask):
    """Put the apple on the floor."""

    home = "{home}"
    goal = "(on_floor apple kitchen_0)"
    robots = {{"humanoid": (0.0, -1.0, 90.0)}}
    horizon = 20

    def measure(self, world):
        return {{"reach": world.reach("apple")}}

    def reward(self, world):
        return {{"reach": world.falls("reach"), "effort": -0.01 * jnp.square(world.action).sum(1)}}

    def failure(self, world):
        return world.com("apple")[:, 2] < -1.0

    def observe(self, world):
        return {{"apple": world.in_base(world.com("apple")), "held": world.holds("apple"), "left": world.time_left}}
'''


def write_task(folder: pathlib.Path, home: pathlib.Path, text: str = APPLE, name: str = "my_tasks.py") -> pathlib.Path:
    """A file with the task; in `text` braces are doubled and {home} stands for the home's folder."""
    file = folder / name
    file.write_text(textwrap.dedent(text.format(home=home)))
    return file
