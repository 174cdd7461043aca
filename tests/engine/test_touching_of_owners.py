"""Touching of objects and agents, made of packed touching of their units."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.engine.mjx.touching import of_owners, packed
from ig2mj.engine.mjx.view import slots


@pytest.mark.parametrize("units", [1, 31, 32, 33, 110])
def test_owners_touch_where_any_of_their_units_do(units):
    rng = np.random.default_rng(units)
    touching = rng.random((5, units, units)) < 2 / units
    owner = rng.integers(-1, 7, units)  # -1: an agent's, or of nobody
    own = owner == np.arange(8)[:, None]  # the last owner has no unit
    first, other = slots(owner, 8), slots(owner, 3)
    expected = np.einsum("ou,wuv,pv->wop", own, touching, own) > 0
    assert units < 31 or 0 < expected.mean() < 1
    words = packed(jnp.asarray(touching))
    np.testing.assert_array_equal(of_owners(words, first, first), expected)
    np.testing.assert_array_equal(of_owners(words, first, other), expected[:, :, :3])
