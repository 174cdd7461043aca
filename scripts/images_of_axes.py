"""Images of docs/guide/randomization.md: what each axis of `ig2mj.Randomize` changes, on the native engine.

python3 scripts/images_of_axes.py docs/images
"""

from __future__ import annotations

import pathlib
import sys

import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.engine.model_fields import ModelFields, own_fields
from ig2mj.sensors.noise import noisy
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.randomize import Materials, SensorNoise

WORLDS, SIDE, SEED = 5, 192, 4
"""Images of each axis, pixels of each, and the seed."""


def main(folder: pathlib.Path) -> None:
    """Writes randomization_<axis>.jpg into the folder."""
    axes = ["materials", "lights", "camera", "sensor_noise"]
    size = {"width": SIDE, "height": SIDE}
    env = ig2mj.make(
        "CookingMeat", "humanoid", WORLDS, "native", pool_size=8, observations="rgb", sensors=size, randomize=axes
    )
    sensors, core = env._observer._sensors, env.core
    state = env.start_from(np.zeros(WORLDS, int), SEED)
    drawn, batch = state.draw, state.batch
    fields = core.engine.snapshot(batch.world.physics).model_fields
    names = Materials.model_fields
    own = own_fields(env.scene.model, names)
    plain = ModelFields(**{n: np.broadcast_to(a, (WORLDS, *a.shape)) for n in names for a in (getattr(own, n),)})

    def shot(batch, draw: Draw) -> np.ndarray:
        world = batch.world
        seen, _ = sensors.look_fn(world.physics, world.view, world.states, batch.controllers[0], draw=draw)
        return np.asarray(seen["rgb"])

    def coloured(batch, own: ModelFields):
        return core.write(batch, Write(model_fields=ModelFields(**{n: getattr(own, n) for n in names})))

    def save(axis: str, images: np.ndarray) -> None:
        gap = np.full((SIDE, 4, 3), 255, np.uint8)
        parts = [part for image in images for part in (image, gap)][:-1]
        Image.fromarray(np.concatenate(parts, axis=1)).save(folder / f"randomization_{axis}.jpg", quality=88)

    batch = coloured(batch, plain)
    first = core.engine.export(batch.world.physics, 0)
    states = jax.tree.map(lambda a: np.repeat(np.asarray(a)[:1], WORLDS, 0), batch.world.states)
    batch = core.load(batch, first, states)
    still = shot(batch, Draw())
    save("lights", shot(batch, Draw(light_colour=drawn.light_colour, light_quat=drawn.light_quat)))
    camera = {name: getattr(drawn, name) for name in ("camera_pos", "camera_quat", "camera_slope")}
    save("camera", shot(batch, Draw(**camera)))
    keys, level = jax.random.split(jax.random.PRNGKey(0), WORLDS), jnp.linspace(0.0, 1.0, WORLDS)
    save("sensor_noise", np.asarray(noisy({"rgb": still}, env.observation_spaces, SensorNoise(), level, keys)["rgb"]))
    save("materials", shot(coloured(batch, fields), Draw()))
    # From one start state, but for the poses. Fetch looks down on the counter.
    for axis, robot in {"objects": "fetch", "object_poses": "fetch", "robot_start": "humanoid"}.items():
        env = ig2mj.make(
            "CookingMeat", robot, WORLDS, "native", pool_size=8, observations="rgb", sensors=size, randomize=[axis]
        )
        state = env.start_from(np.zeros(WORLDS, int), SEED)
        save(axis, np.asarray(state.obs["rgb"]))


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
