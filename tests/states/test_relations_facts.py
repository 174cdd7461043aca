"""Adjacency, nearness and the memo of relations: iGibson's rules, two bugs that are not copied, paper table A.4."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item, answers, shell

from ig2mj.states import RelationPlan
from ig2mj.states.relations.adjacency import HORIZONTAL_LENGTH, HORIZONTAL_LINES, VERTICAL_LENGTH

SMALL = (((0, 0, 0), (0.05, 0.05, 0.05)),)
HOME = HandWorld(
    Item("ball", SMALL, pos=(0, 0, 2)),
    Item("slab", (((0, 0, 0), (0.5, 0.5, 0.02)),), pos=(0, 0, 1)),
    Item("box", shell(0.6, 0.6, 0.6), pos=(5, 0, 1)),
    Item("basket", shell(0.6, 0.6, 0.6, top=False), pos=(8, 0, 1)),
)
QUERIES = [
    (kind, a, b)
    for kind in ("inside", "vertical", "horizontal", "near")
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 0), (0, 0))
]
PLAN = {compat: RelationPlan.build(HOME.model(compat=compat), QUERIES) for compat in ("paper", "igibson")}
EVALUATE = {compat: jax.jit(lambda view, plan=plan: plan.evaluate(view).values) for compat, plan in PLAN.items()}


def _ask(name: str, target: str, pos, compat: str = "paper", **view) -> bool:
    """One relation of the ball to a target, the ball being at `pos`."""
    kind = {"above": "vertical", "below": "vertical", "beside": "horizontal"}.get(name, name)
    values = EVALUATE[compat](HOME.view({"ball": pos}, **view))
    row = values[kind][0, PLAN[compat].index[kind][(0, HOME.index[target])]]
    return bool(row[1 if name == "below" else 0])


def test_horizontal_axes_stand_at_five_angles():
    angles = np.rad2deg(np.arctan2(HORIZONTAL_LINES[:4, 1], HORIZONTAL_LINES[:4, 0]))
    assert np.allclose(angles, [0, 22.5, 45, 67.5], atol=1e-4)
    assert np.allclose(np.sum(HORIZONTAL_LINES[:4] * HORIZONTAL_LINES[4:], axis=-1), 0, atol=1e-6)
    assert np.allclose(HORIZONTAL_LINES[4], [0, 1, 0])  # the plane at 90 degrees is this one again


def test_lengths_of_igibsons_rays():
    assert (HORIZONTAL_LENGTH["igibson"], VERTICAL_LENGTH["igibson"]) == (1.0, 5.0)


def test_table_a4_in_same_positive_and_negative_vertical_axis_objs():
    assert _ask("below", "slab", (0, 0, 2)) and not _ask("above", "slab", (0, 0, 2))
    assert _ask("above", "slab", (0.4, 0.4, 0)) and not _ask("below", "slab", (0.4, 0.4, 0))
    assert not _ask("below", "slab", (0.6, 0, 2)) and not _ask("above", "slab", (0.6, 0, 0))


def test_table_a4_in_same_horizontal_plane_objs():
    assert _ask("beside", "slab", (0.9, 0, 1.0))
    assert _ask("beside", "slab", (0.7, 0.7, 1.0))
    assert not _ask("beside", "slab", (0.9, 0, 1.1))


def test_a_ray_that_starts_inside_a_piece_does_not_hit_it():
    assert not _ask("above", "slab", (0, 0, 1)) and not _ask("below", "slab", (0, 0, 1))


def test_igibsons_rays_end_after_one_and_five_metres():
    assert _ask("below", "slab", (0, 0, 6.5)) and not _ask("below", "slab", (0, 0, 6.5), "igibson")
    assert _ask("below", "slab", (0, 0, 5.9), "igibson")
    assert _ask("beside", "slab", (1.6, 0, 1)) and not _ask("beside", "slab", (1.6, 0, 1), "igibson")


def test_no_number_of_pieces_on_the_ray_hides_one():
    stack = [((0, 0, -0.1 * k), (0.1, 0.1, 0.02)) for k in range(30)]
    home = HandWorld(Item("ball", SMALL, pos=(0, 0, 1)), Item("rack", stack), Item("floor", pos=(0, 0, -6)))
    plan = RelationPlan.build(home.model(), [("vertical", 0, 2), ("vertical", 0, 1)])
    relations = answers(plan, home.view())
    assert relations.below([(0, 2), (0, 1)])[0].tolist() == [True, True]


@pytest.mark.parametrize(
    ("target", "place", "inside"),
    [
        ("box", (5, 0, 1), True),
        ("box", (5.2, 0.1, 0.8), True),
        ("box", (5, 0, 1.5), False),  # on it
        ("box", (5.5, 0, 1), False),  # beside it
        ("basket", (8, 0, 1), True),  # no lid: two horizontal axes
        ("basket", (8, 0, 1.4), False),  # above the rim
        ("slab", (0, 0, 1), False),  # embedded in a solid
    ],
)
@pytest.mark.parametrize("compat", ["paper", "igibson"])
def test_inside_needs_two_orthogonal_axes(target, place, inside, compat):
    assert _ask("inside", target, place, compat) == inside


def test_one_axis_is_not_enough():
    # Between two walls, with nothing above, below, in front or behind.
    walls = [((-0.5, 0, 0), (0.05, 0.3, 0.3)), ((0.5, 0, 0), (0.05, 0.3, 0.3))]
    tunnel = [*walls, ((0, 0, -0.4), (0.5, 0.3, 0.05)), ((0, 0, 0.4), (0.5, 0.3, 0.05))]
    home = HandWorld(Item("ball", SMALL), Item("walls", walls), Item("tunnel", tunnel))
    plan = RelationPlan.build(home.model(), [("inside", 0, 1), ("inside", 0, 2)])
    assert answers(plan, home.view()).inside([(0, 1), (0, 2)])[0].tolist() == [False, True]


def test_a_wide_container_is_out_of_reach_of_igibsons_rays():
    home = HandWorld(Item("ball", SMALL), Item("hall", shell(4, 4, 2)))
    for compat, expected in (("paper", True), ("igibson", False)):
        plan = RelationPlan.build(home.model(compat=compat), [("inside", 0, 1)])
        assert bool(answers(plan, home.view()).inside([(0, 1)])[0, 0]) == expected


def test_near_is_a_third_of_the_mean_edge():
    # Unit cubes: one third of a metre between them.
    cubes = HandWorld(Item("a"), Item("b"))
    for compat in ("paper", "igibson"):
        plan = RelationPlan.build(cubes.model(compat=compat), [("near", 0, 1)])
        near = jax.jit(lambda view, plan=plan: plan.evaluate(view).near([(0, 1)])[0, 0])
        assert near(cubes.view({"b": (1.333, 0, 0)})) and not near(cubes.view({"b": (1.334, 0, 0)}))
        assert near(cubes.view({"b": (0.2, 0.1, 0)}))


def test_the_paper_measures_closest_points_and_the_code_boxes():
    # A cube turned by 45 degrees: its box reaches farther than its side.
    turned = {"b": (np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8))}
    cubes = HandWorld(Item("a"), Item("b"))
    view = cubes.view({"b": (1.0, 1.0, 0)}, quat=turned)
    found = {}
    for compat in ("paper", "igibson"):
        plan = RelationPlan.build(cubes.model(compat=compat), [("near", 0, 1)])
        found[compat] = bool(answers(plan, view).near([(0, 1)])[0, 0])
    # Boxes overlap; the surfaces are 0.207 m apart, under the limit; move on until only the boxes are near.
    assert found == {"paper": True, "igibson": True}
    view = cubes.view({"b": (1.2, 1.2, 0)}, quat=turned)
    distance = np.hypot(1.2, 1.2) - np.sqrt(0.5) - 0.5
    limit = (3 + 1 + 2 * np.sqrt(2)) / 18
    assert distance > limit > 1.2 - 0.5 - np.sqrt(0.5)
    for compat, expected in (("paper", False), ("igibson", True)):
        plan = RelationPlan.build(cubes.model(compat=compat), [("near", 0, 1)])
        assert bool(answers(plan, view).near([(0, 1)])[0, 0]) == expected


def test_nan_poses_and_the_object_itself_relate_to_nothing():
    for name, place in (("below", (np.nan, 0, 2)), ("inside", (5, np.nan, 1)), ("beside", (0.9, 0, np.nan))):
        assert not any(_ask(name, target, place) for target in ("slab", "box", "basket"))
    assert not _ask("near", "slab", (np.nan, 0, 1.1))
    assert not _ask("below", "ball", (0, 0, 2)) and not _ask("near", "ball", (0, 0, 2))


def test_what_turns_about_its_own_centre_relates_anew():
    home = HandWorld(Item("ball", SMALL, pos=(0.5, 0, 1)), Item("plank", (((0, 0, 0), (0.8, 0.1, 0.02)),)))
    plan = RelationPlan.build(home.model(), [("vertical", 0, 1)])
    turned = home.view(quat={"plank": (np.sqrt(0.5), 0, 0, np.sqrt(0.5))})
    assert [bool(answers(plan, view).below([(0, 1)])[0, 0]) for view in (home.view(), turned)] == [True, False]


@pytest.mark.slow
def test_relations_work_for_any_number_of_worlds():
    view = jax.tree.map(
        lambda a, b: jnp.concatenate([a, b]), HOME.view({"ball": (0, 0, 2)}), HOME.view({"ball": (5, 0, 1)})
    )
    values, index = EVALUATE["paper"](view), PLAN["paper"].index
    assert values["vertical"][:, index["vertical"][(0, 1)], 1].tolist() == [True, False]
    assert values["inside"][:, index["inside"][(0, 2)], 0].tolist() == [False, True]


def test_asking_for_nothing_gives_empty_arrays():
    plan = RelationPlan.build(HOME.model(), [])
    assert plan.evaluate(HOME.view(worlds=2)).inside([]).shape == (2, 0)
