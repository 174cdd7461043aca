"""Programs that write their results over their arguments."""

import re

import jax
import jax.numpy as jnp
import pytest

from ig2mj.process.gc_pause import Compiled
from ig2mj.process.large_constants import LEAST


def _places(program: Compiled, *args: object) -> list[int]:
    """Numbers of the results that are written over an argument, in the order of the arguments."""
    text = program.trace(*args).lower().as_text()
    return [int(number) for number in re.findall(r"tf\.aliasing_output = (\d+)", text)]


@pytest.mark.parametrize("constant", [4, LEAST])
def test_what_a_function_does_not_read_is_written_in_place_too(constant: int):
    large = jnp.arange(constant, dtype=jnp.float32)

    def step(state: dict[str, jax.Array], action: jax.Array) -> dict[str, jax.Array]:
        return {"position": state["position"] + action + large.sum(), "reward": 2.0 * action}

    state = {"position": jnp.zeros(3), "reward": jnp.zeros(3)}
    assert _places(Compiled(step, donate_argnums=0), state, jnp.ones(3)) == [0, 1]


def test_arguments_that_are_not_donated_may_be_left_out():
    text = Compiled(lambda x, _: x + 1).trace(jnp.zeros(3), jnp.zeros(5)).lower().as_text()
    assert "tensor<5xf32>" not in text
