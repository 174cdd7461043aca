"""A model of many parts: quick enough, with progress by part, and every other size at once."""

from __future__ import annotations

import resource

import pytest
from chest_of_drawers import write_chest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_object import convert_object


def processor_seconds() -> float:
    """Of this process and of those it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


@pytest.mark.slow
def test_a_chest_of_97_groups_takes_little_and_its_second_size_next_to_nothing(tmp_path, monkeypatch):
    """90 s on two cores are 180 s of processor time; measured: 12 s, and 1.2 s for the second size."""
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    file = write_chest(tmp_path / "chest")
    told: list[tuple[int, int, str]] = []
    options = ConvertOptions(report=False, jobs=2, progress=lambda *what: told.append(what))
    used = []
    for size in (None, (1.0, 0.6, 1.3)):
        before = processor_seconds()
        convert_object(file, "bottom_cabinet", tmp_path / "out", bounding_box=size, options=options)
        used.append(processor_seconds() - before)
    assert used[0] < 90
    assert used[1] < 0.25 * used[0]
    shapes = {text for _, total, text in told if total == 97}
    assert len(shapes) > 20 and all(text.startswith("link ") for text in shapes)
    assert any(": part " in text for _, _, text in told)
