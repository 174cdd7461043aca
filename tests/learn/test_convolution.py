"""`ig2mj.learn.convolution`: the two ways to convolve agree, and a program has only that of its platform."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.learn.convolution import by_product, by_xla
from ig2mj.learn.networks import Convolutions

SIZES = [((32, 32), 2), ((48, 128), 2), ((15, 11), 2), ((24, 24), 1), ((5, 2), 3)]


@pytest.mark.parametrize(("shape", "stride"), SIZES)
def test_both_ways_give_the_same_and_the_same_gradients(shape, stride):
    rng = np.random.default_rng(0)
    inputs = jnp.asarray(rng.normal(size=(2, *shape, 4)), jnp.float32)
    kernel = jnp.asarray(rng.normal(size=(3, 3, 4, 6)), jnp.float32)
    (one, back), (other, other_back) = (
        jax.vjp(lambda x, k, way=way: way(x, k, stride), inputs, kernel) for way in (by_product, by_xla)
    )
    np.testing.assert_allclose(one, other, atol=1e-4)
    slope = jnp.asarray(rng.normal(size=one.shape), jnp.float32)
    for a, b in zip(back(slope), other_back(slope), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("platform", "convolves"), [("cpu", False), ("cuda", True)])
def test_a_program_convolves_as_its_platform_does(platform, convolves):
    encoder, pictures = Convolutions((32, 32, 4), "points"), jnp.zeros((2, 32 * 32 * 4), jnp.uint8)
    params = jax.jit(encoder.init)(jax.random.PRNGKey(0), pictures)

    def slope(params, pictures):
        return jax.grad(lambda p: encoder.apply(p, pictures).sum())(params)

    lowered = jax.jit(slope).trace(params, pictures).lower(lowering_platforms=(platform,))
    assert ("convolution" in lowered.as_text()) == convolves
