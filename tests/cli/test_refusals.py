"""What is wrong is said once, with what to do about it."""

import pytest

import ig2mj
from ig2mj.cli.common.axes import chosen_episodes
from ig2mj.cli.common.jobs import tell_failures
from ig2mj.errors import EngineError, InputError, StateError, UnknownNameError
from ig2mj.learn.episodes import Episodes, parse_axes
from ig2mj.predicates.substances import substance_index
from ig2mj.simulation.simulation import Simulation
from ig2mj.states.model import StateModel


def test_jobs_that_all_fail_alike_are_one_line(capsys):
    tell_failures({f"row_{n}": "no object is named 'aple'" for n in range(64)}, 64)
    assert capsys.readouterr().err == "error: all 64 jobs failed: no object is named 'aple'\n"


def test_failures_are_listed_by_reason(capsys):
    tell_failures({"row_0": "too few", "row_1": "fixed", "row_2": "too few"}, 64)
    assert capsys.readouterr().err.splitlines()[1:] == ["  row_0 and 1 more: too few", "  row_1: fixed"]


def test_settings_of_axes_below_their_least_are_refused_with_it():
    with pytest.raises(EngineError, match="turn = -5: a finite number of at least 0"):
        ig2mj.Randomize(camera={"turn": -5})
    with pytest.raises(EngineError, match="count = 0: a whole number from 1"):
        ig2mj.Randomize(objects={"count": 0})


def test_no_axis_is_refused():
    with pytest.raises(EngineError, match="no axis is named"):
        parse_axes(" , ")


def test_episodes_of_another_task_are_refused(monkeypatch, tmp_path):
    book = tmp_path / "book.npz"
    book.touch()

    class Book:
        header = {"task": "GraspingBook"}  # noqa: RUF012

    monkeypatch.setattr(Episodes, "load", lambda file: Book)
    assert chosen_episodes("GraspingBook", book) is Book
    with pytest.raises(InputError, match="has episodes of GraspingBook, not of CookingMeat"):
        chosen_episodes("CookingMeat", book)


def test_a_truth_in_place_of_a_name_is_refused():
    for method in (Simulation.set_predicate, Simulation.predicate):
        with pytest.raises(StateError, match="False is no name"):
            method(object.__new__(Simulation), "open", "fridge_0", False)  # type: ignore[arg-type]


def test_a_substance_that_is_not_in_use_is_named_with_its_option(tiny_home):
    model = StateModel.of_manifest(tiny_home.tables, tiny_home.manifest)
    with pytest.raises(UnknownNameError, match="--substances flour"):
        substance_index(model, "flour")
    with pytest.raises(UnknownNameError, match=r"'stainn'; near matches: stain$"):
        substance_index(model, "stainn")


def test_a_list_of_names_that_is_none_is_refused(tiny_home_folder):
    with pytest.raises(ig2mj.errors.Ig2mjError, match="3 is no list of names"):
        ig2mj.load_scene(tiny_home_folder, substances=3)  # type: ignore[arg-type]
