"""Which models fit into which rows: contacts of the objects that change places, and of no others."""

from __future__ import annotations

import jax
import mujoco
import numpy as np
import pytest

from ig2mj.errors import EngineError
from ig2mj.process.compilation import XLA_EVENT
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.model_choices import choices_of, widened
from ig2mj.tasks.pools import bare_scene, pool_of
from ig2mj.worlds.model_swaps import only_contacts_of


def _pile(masks: list[tuple[int, int]]) -> mujoco.MjModel:
    """Balls that all overlap, with these collision masks (contype, conaffinity)."""
    balls = "".join(
        f'<body pos="{0.01 * k} 0 0"><freejoint/><geom size=".1" contype="{a}" conaffinity="{b}"/></body>'
        for k, (a, b) in enumerate(masks)
    )
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{balls}</worldbody></mujoco>")


def _pairs(model: mujoco.MjModel) -> set[tuple[int, ...]]:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return {tuple(sorted(pair)) for pair in data.contact.geom.tolist()}


def test_only_pairs_with_the_given_geoms_are_found_and_all_of_these():
    rng = np.random.default_rng(0)
    model = _pile([(int(a), int(b)) for a, b in rng.integers(0, 8, (14, 2))])
    chosen = np.arange(model.ngeom) % 3 == 0
    every = _pairs(model)
    expected = {pair for pair in every if chosen[list(pair)].any()}
    assert _pairs(only_contacts_of(model, chosen)) == expected
    assert expected and expected < every and _pairs(model) == every, "the model itself stays as it is"


def test_more_masks_than_bits_are_refused():
    model = _pile([(k, 1) for k in range(1, 33)])
    with pytest.raises(EngineError, match="32 different collision masks"):
        only_contacts_of(model, np.ones(model.ngeom, bool))


@pytest.mark.slow
def test_models_that_fit_are_found_while_a_program_is_traced_and_nothing_is_compiled_for_it():
    task = ACTIVITIES["CookingMeat"]
    chosen = choices_of(task, "train", 3)
    scene = load_scene(task.home, objects=chosen.task.objects)
    rows, swaps = widened(pool_of(task, "train", 4), bare_scene(task), scene), chosen.swaps(scene)
    compiled, found = [], []

    def note(event: str, duration_secs: float, **about: str | int) -> None:
        if event == XLA_EVENT:
            compiled.append(about)

    jax.monitoring.register_event_duration_secs_listener(note)

    def traced(number):
        found.append(swaps.fits(rows))
        return number

    jax.jit(traced).trace(0)
    assert found[0].shape == (4, 3) and found[0].all() and not compiled
    swapped = swaps.swapped(rows, np.full(4, 2))
    there = swaps._with_others(np.asarray(rows.physics.scene.qpos), swaps._other[2])
    np.testing.assert_allclose(np.asarray(swapped.physics.scene.qpos), there, atol=1e-6)
