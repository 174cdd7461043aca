"""`Worklist`: each listed place is met once, and its answer comes to stand there."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.states.relations.worklist import FEW, Worklist, or_at


@pytest.mark.parametrize("search", [True, False])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_a_list_is_worked_off_in_turns(search, share):
    rng, count = np.random.default_rng(0), 8
    mask, truth = rng.random(50) < share, rng.random(50) < 0.5

    @jax.jit
    def worked(mask):
        listed = Worklist.of(mask, count, search)

        def some(turn, carried):
            answers, met = carried
            places = listed.places(turn * count)
            known = jnp.where(places < 50, jnp.asarray(truth)[jnp.minimum(places, 49)], True)  # beyond: a wrong answer
            return listed.noted(answers, turn * count, known), met.at[places].add(1, mode="drop")

        turns = (jnp.sum(mask) + count - 1) // count
        answers, met = jax.lax.fori_loop(0, turns, some, (listed.no_answers(), jnp.zeros(50, int)))
        return listed.in_place(answers), met

    found, met = worked(mask)
    assert np.array_equal(found, mask & truth) and np.array_equal(met, mask.astype(int))


@pytest.mark.parametrize("size", [10, FEW])
def test_any_answer_of_a_place_makes_it_true(size):
    places, answers = np.array([3, 3, 7, 9, size, size + 5]), np.array([False, True, True, False, True, True])
    found = or_at(jnp.zeros(size, bool).at[1].set(True), jnp.asarray(places), jnp.asarray(answers))
    assert np.flatnonzero(found).tolist() == [1, 3, 7]
