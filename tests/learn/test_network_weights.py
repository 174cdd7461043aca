"""First weights of networks."""

import re

import jax
import numpy as np

from ig2mj.learn.networks import orthogonal


def test_columns_are_orthogonal_and_differ_between_stacked_networks():
    init = orthogonal(0.5)
    stacked = np.asarray(jax.vmap(lambda key: init(key, (9, 4)))(jax.random.split(jax.random.PRNGKey(0))))
    assert np.allclose(stacked.transpose(0, 2, 1) @ stacked, 0.25 * np.eye(4), atol=1e-5)
    assert np.abs(stacked[0] - stacked[1]).max() > 0.05


def test_matrices_are_factorized_one_after_another():
    def both(keys):
        return jax.vmap(lambda key: orthogonal(1.0)(key, (16, 8)))(keys)

    text = jax.jit(both).lower(jax.random.split(jax.random.PRNGKey(0))).as_text()
    shapes = re.findall(r"custom_call @lapack_sgeqrf.*?-> \(?tensor<([0-9x]+)xf32>", text)
    assert shapes and set(shapes) == {"16x8"}, "jaxlib 0.10.2 waits forever for several at once on two cores"
