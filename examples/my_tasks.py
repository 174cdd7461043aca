"""Three tasks of one's own. The first: `ig2mj train examples/my_tasks.py:MugToCarpet --worlds 8 --minutes 1`.

`ig2mj list-envs examples/my_tasks.py` lists them; docs/guide/own_tasks.md explains what a task may state.
"""

from typing import ClassVar

import jax.numpy as jnp

import ig2mj


@ig2mj.register_task
class MugToCarpet(ig2mj.CustomTask):
    """Bring the mug from the coffee table to the carpet."""

    home = "birch"
    objects = ("mug",)
    start = ("(on_top mug_0 coffee_table_0)",)
    goal = "(on_top mug_0 carpet_0)"
    robots = ("humanoid", "fetch")

    def measure(self, world):
        return {"reach": world.reach("mug_0"), "height": world.com("mug_0")[:, 2]}

    def reward(self, world):
        return {
            "reach": world.falls("reach"),
            "lower": jnp.where(world.holds("mug_0"), 2.0 * world.falls("height"), 0.0),
            "done": 10.0 * world.goal.holds,
        }

    def observe(self, world):
        return {
            "hand": world.in_base(world.hand_pos()),
            "mug": world.in_base(world.com("mug_0")),
            "holds": world.holds("mug_0"),
            "left": world.time_left,
        }


@ig2mj.register_task
class VisitFridge(ig2mj.CustomTask):
    """Drive to the fridge; the mug stands in the way."""

    home = "birch"
    objects = ("mug",)
    robots: ClassVar = {"turtlebot": (1.8, -1.0, 180.0)}
    whole_actions = True
    horizon = 300

    def start(self, home, rng):
        home.put("mug_0", (rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), 0.1), yaw=rng.uniform(0, 360))

    def measure(self, world):
        offset = world.pos("fridge_0")[:, :2] - world.base_pos()[:, :2]
        return {"distance": jnp.linalg.norm(offset, axis=1)}

    def reward(self, world):
        return world.falls("distance") - 0.1 * world.touches("mug_0")

    def success(self, world):
        return world.now["distance"] < 1.0


@ig2mj.register_task
class GentleNavigation(ig2mj.CustomTask):
    """PointNavigation with a price on what the wheels do."""

    base = "PointNavigation"

    def measure(self, world):
        return {"speed": jnp.linalg.norm(world.view.agent.base_linvel[:, 0], axis=1)}

    def reward(self, world):
        return {"moves": 0.1 * world.now["speed"], "effort": -0.05 * jnp.square(world.action).sum(1)}
