"""Adam with gradients averaged over devices: the mean gradient's step, from one exchange of one array."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from ig2mj.learn.adam import averaged_adam

SHAPES = {"bias": (3,), "kernel": (4, 3), "scale": ()}


def gradients(devices: int) -> Any:
    rng = np.random.default_rng(5)
    return {name: jnp.asarray(rng.normal(size=(devices, *shape)), jnp.float32) for name, shape in SHAPES.items()}


@pytest.mark.slow
@pytest.mark.parametrize("largest", [0.5, 100.0])  # cut down, and not
def test_a_step_is_that_of_the_mean_gradient(largest):
    slopes = gradients(4)
    mean = jax.tree.map(lambda a: a.mean(0), slopes)
    plain: Any = optax.chain(optax.clip_by_global_norm(largest), optax.scale_by_adam(eps=1e-3))
    shared: Any = averaged_adam(largest, "devices", eps=1e-3)
    expected, state = plain.init(mean), shared.init(mean)
    update = jax.vmap(shared.update, in_axes=(0, None), axis_name="devices", out_axes=0)
    for _ in range(2):
        step, expected = plain.update(mean, expected)
        found, states = update(slopes, state)
        state = jax.tree.map(lambda a: a[0], states)
        for name in SHAPES:
            np.testing.assert_allclose(found[name], np.broadcast_to(step[name], found[name].shape), atol=1e-6)
    single: Any = averaged_adam(largest, eps=1e-3)
    alone, _ = single.update(mean, single.init(mean))
    first, _ = plain.update(mean, plain.init(mean))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-6), alone, first)


def test_all_arrays_are_exchanged_at_once():
    adam, one = averaged_adam(1.0, "devices"), jax.tree.map(lambda a: a[0], gradients(1))
    program = jax.make_jaxpr(adam.update, axis_env=[("devices", 2)])(one, adam.init(one))
    exchanged = [e for e in program.eqns if e.primitive.name.startswith("psum")]
    assert [[v.aval.shape for v in e.invars] for e in exchanged] == [[(3 + 12 + 1,)]]
