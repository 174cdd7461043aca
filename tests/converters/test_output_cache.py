"""Finished outputs are kept by the content of all they were made from, and used only while nothing has changed."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import pathlib
import re
import shutil
import sys

import numpy as np
import pytest
from ig2mj_converters.base import inputs, output_cache
from ig2mj_converters.base.cache_folder import prune
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.base.output import put_shared_file
from ig2mj_converters.conversion import convert_object, convert_scene
from PIL import Image
from tiny_geometry import box, write_obj
from tiny_house import SCENE

from ig2mj.cli import call
from ig2mj.errors import InputError
from ig2mj.scene.manifest import load_manifest

BARE = ConvertOptions(report=False)


def contents(folder: pathlib.Path) -> dict[str, str]:
    return {
        str(f.relative_to(folder)): hashlib.sha256(f.read_bytes()).hexdigest()
        for f in sorted(folder.rglob("*"))
        if f.is_file()
    }


def masses(folder: pathlib.Path) -> dict[str, float]:
    return {entry.name: entry.mass for entry in load_manifest(folder).objects}


@pytest.fixture
def own(tmp_path, dataset) -> pathlib.Path:
    """A copy of the tiny dataset that a test may change, with a texture."""
    root = pathlib.Path(shutil.copytree(dataset, tmp_path / "own"))
    model = root / "objects" / "stove" / "st0"
    write_obj(model / "shape" / "visual" / "v.obj", [("", box((0.6, 0.6, 0.9)))])
    text = (model / "shape" / "visual" / "v.obj").read_text()
    text = re.sub(r"(?m)^f (\d+) (\d+) (\d+)$", r"f \1/1 \2/1 \3/1", text)
    (model / "shape" / "visual" / "v.obj").write_text(f"mtllib d.mtl\nvt 0 0\nusemtl d\n{text}")
    (model / "shape" / "visual" / "d.mtl").write_text("newmtl d\nmap_Kd ../../material/DIFFUSE.png\n")
    (model / "material").mkdir()
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(model / "material" / "DIFFUSE.png")
    urdf = (model / "st0.urdf").read_text()
    seen = '<visual><geometry><mesh filename="shape/visual/v.obj"/></geometry></visual><collision>'
    (model / "st0.urdf").write_text(urdf.replace("<collision>", seen, 1))
    return root


def scene(root: pathlib.Path, out: pathlib.Path, **options):
    return convert_scene(root, SCENE, out, options=dataclasses.replace(BARE, **options))


def test_the_second_conversion_is_the_first_ones_output(own, tmp_path, capsys):
    arguments = ["convert", "scene", "--no-report", "--dataset", str(own), "--scene", SCENE, "--out"]
    assert call([*arguments, str(tmp_path / "a"), "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert call([*arguments, str(tmp_path / "b"), "--json"]) == 0
    second = json.loads(capsys.readouterr().out)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert (first["cached"], second["cached"]) == (False, True)
    assert [second[key] for key in ("objects", "warnings", "skipped", "checks")] == [
        first[key] for key in ("objects", "warnings", "skipped", "checks")
    ]


def test_every_file_that_a_conversion_opens_is_on_record(own, tmp_path):
    opened: set[str] = set()
    watching = True

    def hook(event: str, arguments: tuple) -> None:
        if watching and event == "open" and isinstance(arguments[0], str | bytes | pathlib.Path):
            opened.add(str(pathlib.Path(str(arguments[0])).absolute()))

    sys.addaudithook(hook)
    with inputs.recording() as record:
        scene(own, tmp_path / "out", cache=False)
    watching = False
    below = {path for path in opened if path.startswith(str(own)) and pathlib.Path(path).is_file()}
    assert any(path.endswith("DIFFUSE.png") for path in below) and len(below) > 20
    assert below <= {question.split(" ", 1)[1] for question in record.answers if question.startswith("content ")}
    assert record.consistent and record.holds_still()


CHANGES = {
    "a collision mesh": "objects/stove/st0/shape/collision/base_link_cm.obj",
    "a visual mesh": "objects/stove/st0/shape/visual/v.obj",
    "its materials": "objects/stove/st0/shape/visual/d.mtl",
    "a texture": "objects/stove/st0/material/DIFFUSE.png",
    "an encrypted visual": "objects/breakfast_table/tab0/shape/visual/table.encrypted.obj",
    "an object's URDF": "objects/stove/st0/st0.urdf",
    "an object's metadata": "objects/stove/st0/misc/metadata.json",
    "the category masses": "metadata/avg_category_specs.json",
    "the room types": "metadata/room_categories.txt",
    "the scene file": f"scenes/{SCENE}/urdf/{SCENE}_best.urdf",
    "a building part": f"scenes/{SCENE}/urdf/{SCENE}_walls.urdf",
    "the room map": f"scenes/{SCENE}/layout/floor_insseg_0.png",
    "the version": "VERSION",
}


def test_a_change_to_any_input_counts_and_undoing_it_counts_too(own, tmp_path):
    with inputs.recording() as record:
        scene(own, tmp_path / "out", cache=False)
    for what, name in CHANGES.items():
        file = own / name
        before = file.read_bytes()
        file.write_bytes(before + b"\n")
        assert not record.holds_still(), what
        file.write_bytes(before)
    for name in ("objects/stove/st0/st0_simplified.urdf", f"scenes/{SCENE}/misc/bbox_overlap.json"):
        new = own / name
        before = new.read_bytes() if new.exists() else None
        new.unlink() if before is not None else new.write_text("<robot/>")
        assert not record.holds_still(), name
        new.unlink() if before is None else new.write_bytes(before)
    assert record.holds_still()


def test_changed_input_is_converted_anew(own, tmp_path):
    assert not scene(own, tmp_path / "out").cached
    assert scene(own, tmp_path / "out").cached
    specs = own / "metadata" / "avg_category_specs.json"
    before = masses(tmp_path / "out")
    facts = json.loads(specs.read_text())
    facts["stove"]["density"] *= 2
    specs.write_text(json.dumps(facts))
    assert not scene(own, tmp_path / "out").cached
    assert masses(tmp_path / "out") == pytest.approx(before | {"stove_0": 2 * before["stove_0"]})
    assert scene(own, tmp_path / "out").cached


def test_random_models_depend_on_what_the_category_folder_holds(own):
    with inputs.recording() as record:
        names = inputs.folders_in(own / "objects" / "stove")
    assert names == ["st0"] and record.holds_still()
    (own / "objects" / "stove" / "st1").mkdir()
    assert not record.holds_still()


@pytest.mark.parametrize(
    "other",
    [{"seed": 1}, {"fixed_furniture": True}, {"only_rooms": ("kitchen",)}, {"max_hulls": 3}, {"bullet_inertia": True},
     {"ceiling_collision": True}, {"skip_missing": True}, {"colours": "category"}, {"report": True},
     {"keep_hovering": True}, {"only_categories": ("bed",)}, {"max_hull_vertices": 9}],
    ids=lambda other: next(iter(other)),
)  # fmt: skip
def test_every_option_that_decides_what_comes_out_is_part_of_the_key(other):
    key = output_cache.key_of({"kind": "scene"}, BARE)
    assert output_cache.key_of({"kind": "scene"}, dataclasses.replace(BARE, **other)) != key
    assert output_cache.key_of({"kind": "scene"}, dataclasses.replace(BARE, jobs=2)) == key
    assert output_cache.key_of({"kind": "object"}, BARE) != key


def test_versions_and_the_converters_own_source_are_part_of_the_key(monkeypatch):
    key = output_cache.key_of({}, BARE)
    with monkeypatch.context() as patch:
        patch.setattr(output_cache, "_version", lambda name: "9")
        assert output_cache.key_of({}, BARE) != key
    monkeypatch.setattr(output_cache, "_source_hash", lambda name: "9")
    assert output_cache.key_of({}, BARE) != key


@pytest.mark.parametrize("damage", ["cut off", "other bytes", "empty"])
def test_a_damaged_entry_is_taken_as_absent(damage, own, tmp_path, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    urdf = own / "objects" / "sink" / "si0" / "si0.urdf"
    convert_object(urdf, "sink", tmp_path / "out", options=BARE)
    (entry,) = (tmp_path / "cache" / "outputs").rglob("*.zip")
    raw = bytearray(entry.read_bytes())
    middle = len(raw) // 3
    raw[middle : middle + 50] = b"\x55" * 50
    entry.write_bytes({"cut off": entry.read_bytes()[:-200], "other bytes": bytes(raw), "empty": b""}[damage])
    before = contents(tmp_path / "out")
    assert not convert_object(urdf, "sink", tmp_path / "out", options=BARE).cached
    assert contents(tmp_path / "out") == before
    assert convert_object(urdf, "sink", tmp_path / "out", options=BARE).cached
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cache", "out", "own"]


def test_no_cache_neither_reads_nor_writes(own, tmp_path, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "cache"))
    urdf = own / "objects" / "sink" / "si0" / "si0.urdf"
    arguments = ["convert", "object", "--urdf", str(urdf), "--category", "sink", "--no-report", "--out"]
    assert call([*arguments, str(tmp_path / "a"), "--no-cache"]) == 0
    assert not (tmp_path / "cache").exists()


def test_a_cache_folder_that_cannot_be_written_is_no_error(own, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path / "file" / "cache"))
    urdf = own / "objects" / "sink" / "si0" / "si0.urdf"
    for _ in range(2):
        assert not convert_object(urdf, "sink", tmp_path / "out", options=BARE).cached


def test_a_hit_overwrites_nothing_that_is_no_output(own, tmp_path):
    urdf = own / "objects" / "sink" / "si0" / "si0.urdf"
    convert_object(urdf, "sink", tmp_path / "out", options=BARE)
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1.tex").write_text("years of work")
    with pytest.raises(InputError, match="thesis"):
        convert_object(urdf, "sink", tmp_path / "thesis", options=BARE)


def test_input_that_changes_while_it_is_read_is_noticed(tmp_path):
    file = tmp_path / "a"
    with inputs.recording() as outer:
        with inputs.recording() as record:
            file.write_text("one")
            inputs.content(file)
            file.write_text("two")
            inputs.content(file)
        assert not record.consistent
    assert not outer.consistent


def test_a_provisional_outcome_is_not_kept(own, tmp_path):
    def no_picture(*_, **__):
        raise RuntimeError("no display")

    urdf = own / "objects" / "sink" / "si0" / "si0.urdf"
    options = ConvertOptions(renderer=no_picture, view=lambda *_, **__: None)
    for _ in range(2):
        outcome = convert_object(urdf, "sink", tmp_path / "out", options=options)
        assert not outcome.cached and "no display" in outcome.provisional[0]


def test_what_was_not_used_for_longest_goes_first(tmp_path):
    for age, name in enumerate(["new", "middle", "old"]):
        (tmp_path / name[:2]).mkdir()
        file = tmp_path / name[:2] / f"{name}.zip"
        file.write_bytes(b"0" * 100)
        os.utime(file, (1e9 - age, 1e9 - age))
    abandoned = tmp_path / "ne" / "x.part"
    abandoned.write_bytes(b"")
    os.utime(abandoned, (1e9, 1e9))
    prune(tmp_path, ".zip", 250)
    assert sorted(f.name for f in tmp_path.rglob("*.*")) == ["middle.zip", "new.zip"]


def test_pipes_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(OSError, match="not a regular file"):
        inputs.content(tmp_path / "pipe.png")


@pytest.mark.slow
def test_homes_with_shared_meshes_come_out_of_the_cache_with_them(own, tmp_path, capsys):
    """A second `homes convert` of what has not changed takes no time and gives the same bytes."""

    def convert(out: str, *options: str) -> tuple[dict[str, str], bool]:
        call(["homes", "convert", "--dataset", str(own), "--out", str(tmp_path / out), "--jobs", "1", *options])
        return contents(tmp_path / out), "1 unchanged, taken from the cache" in capsys.readouterr().out

    first, cached = convert("a")
    assert not cached and any(f.startswith("meshes/") for f in first) and any(f.startswith("textures/") for f in first)
    assert f"{SCENE}/checks.json" in first and not any(f.startswith(f"{SCENE}/meshes") for f in first)
    assert convert("b") == (first, True), "into another folder"
    lost, damaged = sorted((tmp_path / "a" / "meshes").iterdir())[:2]
    lost.unlink()
    damaged.write_bytes(b"v 0 0 0\n")
    assert convert("a") == (first, True), "over an output that is not whole any more"
    assert convert("c", "--no-cache") == (first, False)
    write_obj(own / "objects" / "stove" / "st0" / "shape" / "visual" / "v.obj", [("", box((0.5, 0.6, 0.9)))])
    changed, cached = convert("a")
    assert not cached and changed != first


def test_outputs_with_shared_meshes_have_entries_of_their_own():
    assert output_cache.key_of({}, dataclasses.replace(BARE, assets="..")) != output_cache.key_of({}, BARE)


def test_a_shared_file_is_written_once_and_whole(tmp_path):
    """Processes that convert models of one library share meshes: what is there is left alone, none is half-written."""
    file = tmp_path / "meshes" / "cup-0123.obj"
    put_shared_file(file, b"v 0 0 0\n")
    os.utime(file, (1e9, 1e9))
    put_shared_file(file, b"v 0 0 0\n")
    assert file.stat().st_mtime == 1e9 and file.read_bytes() == b"v 0 0 0\n"
    opened = file.open("rb")
    put_shared_file(file, b"v 1 0 0\n")
    assert opened.read() == b"v 0 0 0\n" and file.read_bytes() == b"v 1 0 0\n", "a reader keeps what it opened"
    opened.close()
    assert [f.name for f in file.parent.iterdir()] == [file.name]
