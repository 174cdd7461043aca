"""Strips of recorded plans: which frames they have, and how words are broken."""

import pytest

from ig2mj.showcase.plan_video import wrapped
from ig2mj.showcase.recorded_plan import strip_frames


@pytest.mark.parametrize(
    "ends, frames",
    [
        ([0, 10, 20, 30, 40], [0, 10, 20, 30, 40]),
        ([0, 10, 20, 30, 40, 50, 60, 70, 80], [0, 20, 40, 60, 80]),
        ([0, 0, 100, 150], [0, 25, 50, 100, 150]),
        ([0, 2], [0, 0, 1, 2, 2]),
    ],
)
def test_a_strip_shows_ends_of_steps_and_what_is_between_few(ends, frames):
    found = strip_frames(ends, 5)
    assert len(found) == 5 and found == sorted(found)
    assert (found[0], found[-1]) == (ends[0], ends[-1])
    assert set(found) == set(frames)


def test_words_are_broken_at_spaces_where_a_line_is_full():
    assert wrapped("place_under modem_0 console_table_2, 15\u00a0s", 20, letters) == (
        "place_under modem_0\nconsole_table_2,\n15\u00a0s"
    )
    assert wrapped("a_word_that_is_longer b", 8, letters) == "a_word_that_is_longer\nb"


def letters(text):
    return float(len(text))
