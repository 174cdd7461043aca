"""Objects of activities that have other models in some episodes: who takes whose place, and what goals say."""

from __future__ import annotations

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.envs.experts import expert_of
from ig2mj.envs.start_choices import varied_models
from ig2mj.errors import EngineError, InputError, UnknownNameError
from ig2mj.scene.library import LibraryModel
from ig2mj.scene.model_splits import SPLIT_FILE, join_split, models_with_parts
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.model_choices import choices_of, widened
from ig2mj.tasks.pools import bare_scene, pool_of
from ig2mj.tasks.registry import load_task
from ig2mj.tasks.splits import models_of
from ig2mj.tasks.variants import variant
from ig2mj.worlds.randomize import Randomize


def test_goals_are_about_whichever_model_is_in_use():
    chosen = choices_of(ACTIVITIES["GraspingBook"], "train", 4)
    (names,) = zip(*chosen.names, strict=True)
    said = " ".join(f"(on_top {name} coffee_table_0)" for name in names)
    assert chosen.task.goal == f"(not (or {said}))"
    assert [t.goal for t in chosen.tasks] == [f"(not (on_top {name} coffee_table_0))" for name in names]
    assert chosen.base.goal == "(not (on_top notebook_0 coffee_table_0))"


def test_all_objects_of_a_task_change_together_and_begin_again():
    chosen = choices_of(variant(ACTIVITIES["SlicingFruit"], 0, "physical"), "train", 4)
    assert chosen.roles == ("apple_0", "carving_knife_0")
    assert len(chosen.names) == 4 and chosen.models[3][1] == chosen.models[0][1]
    assert len({apple for apple, _ in chosen.models}) == 4 and len({knife for _, knife in chosen.models}) == 3


def test_models_of_the_parts_are_others_where_a_category_is_divided():
    parts = [choices_of(ACTIVITIES["SlicingFruit"], part, 6) for part in ("train", "held_out")]
    knives = [{knife for _, knife in chosen.models} for chosen in parts]
    assert not knives[0] & knives[1] and all(knives)


def test_models_of_the_user_join_a_part_of_their_category(tmp_path, monkeypatch):
    """They come first in the part that `ig2mj convert object --split` names, and are in no other."""
    mine = LibraryModel("carving_knife", "mine", tmp_path, own=True)
    join_split(tmp_path, "held_out")
    monkeypatch.setattr("ig2mj.scene.model_splits.own_library", lambda: {"carving_knife": {"mine": mine}})
    entry = SimpleNamespace(fixed=False)
    monkeypatch.setattr(LibraryModel, "entry", entry)
    models, joined = models_with_parts("carving_knife")
    assert models[-1] == "mine" and joined == {"mine": "held_out"}
    assert "mine" in models_of(models, "held_out", joined) and "mine" not in models_of(models, "train", joined)
    (tmp_path / SPLIT_FILE).write_text('{"split": "heldout"}')
    with pytest.raises(InputError, match="near matches: held_out"):
        models_with_parts("carving_knife")
    with pytest.raises(UnknownNameError, match="near matches: train"):
        join_split(tmp_path, "trian")
    (tmp_path / SPLIT_FILE).write_text('{"split": "held_out"}')
    entry.fixed = True
    assert "mine" not in models_with_parts("carving_knife")[0]


def test_only_activities_have_models():
    with pytest.raises(EngineError, match="only the paper's activities have several models"):
        varied_models(load_task("PointNavigation"), Randomize(objects=True), "train")


def test_models_for_friction_alone_take_no_part_with_other_grasping_and_the_other_way_round():
    names = [knife for _, knife in choices_of(ACTIVITIES["SlicingFruit"], "train", 9).models]
    by_friction = choices_of(variant(ACTIVITIES["SlicingFruit"], 0, "physical"), "train", 9)
    standing = {text.partition("/")[2] for texts in ACTIVITIES["SlicingFruit"].physical.objects for text in texts}
    assert not set(names) & standing and {knife for _, knife in by_friction.models} <= standing


def test_models_can_be_named_in_place_of_a_part():
    chosen = choices_of(ACTIVITIES["CookingMeat"], "train", 4, ("steak/steak_02", "steak/steak_00"))
    assert chosen.models == (("steak_02",), ("steak_00",)) and chosen.names[1] == ("steak_0",)
    with pytest.raises(UnknownNameError, match="near matches: steak_02"):
        choices_of(ACTIVITIES["CookingMeat"], "train", 4, ("steak/steak_2",))
    with pytest.raises(EngineError, match="none is a steak"):
        choices_of(ACTIVITIES["CookingMeat"], "train", 4, ("apple/apple_00",))


@pytest.mark.slow
def test_experts_take_whichever_model_is_in_use_and_no_guard_minds_the_others():
    """Also where the home's own object waits on the slab, far below the floor."""
    env = ig2mj.make("GraspingBook", "humanoid", 6, "native", pool_size=6, randomize=["objects"])
    expert, state = expert_of(env), env.start_from(np.arange(6))
    models = np.asarray(state.draw.models)[:, 0]
    assert len(set(models.tolist())) > 1
    success, begun = np.zeros(6, bool), np.asarray(state.batch.world.view.object_pos)[np.arange(6), models]
    ahead = [env.privileged_names.index(name) for name in env.privileged_names if name.startswith("notebook_0")][:1]
    assert np.ptp(np.asarray(state.obs["privileged_state"])[:, ahead]) > 0.01, "ground truth is of the model in use"
    for step in range(40):
        state = env.step(state, np.asarray(expert(state)))
        success |= np.asarray(state.info["success"])
        if step == 2:  # it was put down at rest
            now = np.asarray(state.batch.world.view.object_pos)[np.arange(6), models]
            assert np.linalg.norm(now - begun, axis=1).max() < 0.005
    assert success.all() and not np.asarray(state.info["flags"]).any()


@pytest.mark.slow
def test_another_model_takes_the_place_in_the_row_and_the_first_waits_where_it_did():
    task = ACTIVITIES["CookingMeat"]
    chosen, base = choices_of(task, "train", 4), bare_scene(task)
    scene = load_scene(task.home, objects=chosen.task.objects)
    rows = widened(pool_of(task, "train", 3), base, scene)
    swaps = chosen.swaps(scene)
    assert swaps.fits(rows).shape == (3, 4)  # the models of `choices_of(..., 4)`
    after = jax.jit(swaps.swapped)(rows, jnp.array([0, 1, 2]))
    lows, places = [], []
    for row, name in enumerate(("steak_0", "steak_1", "steak_2")):
        data = mujoco.MjData(scene.model)
        qpos = np.asarray(after.physics.scene.qpos[row])
        data.qpos[: len(qpos)] = qpos
        mujoco.mj_forward(scene.model, data)
        places.append(data.body(name).xpos.copy())
        lows.append(min(c.dist for c in data.contact if name in _objects(scene, c)))
        others = [n for n in ("steak_0", "steak_1", "steak_2") if n != name]
        assert all(data.body(other).xpos[2] < -3 for other in others)
    np.testing.assert_allclose(np.array(places)[:, 2], places[0][2], atol=0.03)
    assert min(lows) > -0.004
    assert np.asarray(swaps.active(_positions(scene, after))).tolist() == [0, 1, 2]
    assert np.asarray(swaps.models(jnp.array([0, 2]))).tolist() == [
        [scene.object_index("steak_0")],
        [scene.object_index("steak_2")],
    ]


def _objects(scene, contact) -> list[str]:
    owners = scene.tables.geom_object[contact.geom]
    return [scene.object_names[o] for o in owners if o >= 0]


def _positions(scene, pool) -> np.ndarray:
    found = np.zeros((pool.size, len(scene.object_names), 3))
    for name in ("steak_0", "steak_1", "steak_2"):
        address = scene.model.joint(f"{name}/free").qposadr[0]
        found[:, scene.object_index(name)] = np.asarray(pool.physics.scene.qpos)[:, address : address + 3]
    return found
