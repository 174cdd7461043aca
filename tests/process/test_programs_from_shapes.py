"""`Compiled.traced` and `compile_together`: programs compiled before there is anything to run them on."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.snapshot import ScenePart
from ig2mj.process.gc_pause import Compiled, compile_together

WIDTHS = {"eq_data": (2, 12), "mocap_pos": (1, 3), "mocap_quat": (1, 4), "touching": (3, 3)}
KINDS = {"eq_active": bool, "touching": bool, "tree_asleep": np.int32}


def part(worlds: int) -> ScenePart:
    """Two coordinates, three units."""
    fields = [field.name for field in dataclasses.fields(ScenePart)]
    return ScenePart(**{n: jnp.zeros((worlds, *WIDTHS.get(n, (2,))), KINDS.get(n, np.float32)) for n in fields})


def test_calls_find_programs_that_were_compiled_from_the_shapes_of_what_others_return():
    traced = []

    def begin(at: jax.Array) -> ScenePart:
        traced.append("begin")
        return dataclasses.replace(part(4), qpos=jnp.full((4, 2), at))

    def step(state: ScenePart, by: jax.Array) -> ScenePart:
        traced.append(f"step {state.qpos.shape}")
        return dataclasses.replace(state, qpos=state.qpos + by)

    first, second, number = Compiled(begin), Compiled(step), jnp.float32(0.5)
    begins = first.traced(number)
    started = begins.returned
    assert started.qpos.shape == (4, 2) and started.tree_asleep.dtype == np.int32
    steps = second.traced(started, number)
    assert steps.returned.qpos.shape == (4, 2)
    compile_together([steps, begins])
    assert traced == ["begin", "step (4, 2)"]
    np.testing.assert_array_equal(second(first(number), number).qpos, np.ones((4, 2)))
    assert traced == ["begin", "step (4, 2)"]
    second(part(3), number)
    assert traced[2:] == ["step (3, 2)"], "other shapes are another program"
