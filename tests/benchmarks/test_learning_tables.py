"""The tables of docs/guide/learning.md are those of the curves and evaluations on file."""

from __future__ import annotations

from benchmarks.learning import curves as learning_curves


def test_the_tables_in_the_documentation_are_computed_from_what_is_on_file():
    page = learning_curves.PAGE.read_text(encoding="utf-8")
    written = page.split(learning_curves.BEGIN)[1].split(learning_curves.END)[0]
    computed = learning_curves.tables(sorted(learning_curves.FOLDER.glob("*.csv")))
    assert written.strip() == computed and "| SlicingFruit | expert (DAgger) |" in computed


def test_a_run_counts_as_there_once_it_never_falls_below_again():
    assert learning_curves.reached([(5, 0, 96.0), (10, 0, 80.0), (15, 0, 95.0), (20, 0, 99.0)]) == 15
    assert learning_curves.reached([(5, 0, 96.0), (10, 0, 80.0)]) is None
