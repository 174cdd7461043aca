"""What a recording is bound to: what determines physics and the values of the task, and neither looks nor names."""

from __future__ import annotations

import dataclasses
import typing
from typing import Any

import mujoco
import pytest

from ig2mj.demos.model_hash import appearance_hash, physics_hash, whole_hash
from ig2mj.demos.task_hash import KINDS, task_hash
from ig2mj.predicates import logic
from ig2mj.tasks import points
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.bddl.task import bddl_task
from ig2mj.tasks.registry import load_task
from ig2mj.tasks.task import Fit

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

SCENE = """<mujoco><asset><mesh name="m" file="{mesh}"/>{assets}</asset>
<worldbody>{world}<body name="b"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<geom type="mesh" mesh="m" friction="{friction}" rgba="{rgba}"/>{inner}<geom name="ball" size="0.1" pos="0 0 1"/></body>
<body name="c" pos="3 0 0"><freejoint/><geom name="other" size="0.1" {named}/></body></worldbody>
<contact><pair geom1="ball" geom2="other"/></contact>
<sensor><distance geom1="ball" geom2="other" cutoff="1"/></sensor></mujoco>"""

PLAIN = {"assets": "", "world": "", "friction": "0.5", "rgba": "1 1 1 1", "inner": "", "named": ""}

LOOKS = {
    "colour": {"rgba": "1 0 0 1"},
    "visual geom": {"inner": '<geom size="1" contype="0" conaffinity="0" mass="0"/>'},
    "visual mesh": {
        "assets": '<mesh name="a" vertex="0 0 0 1 0 0 0 1 0 0 0 2"/>',
        "inner": '<geom type="mesh" mesh="a" contype="0" conaffinity="0"/>',
    },
    "material, texture": {
        "assets": '<texture name="t" type="2d" builtin="flat" width="4" height="4"/><material name="t" texture="t"/>'
    },
    "light, camera": {"world": '<light pos="0 0 9"/><camera name="eye" pos="0 0 3"/>'},
}


def model(folder, **values) -> mujoco.MjModel:
    folder.mkdir(exist_ok=True)
    (folder / "mesh.obj").write_text(MESH)
    return mujoco.MjModel.from_xml_string(SCENE.format(mesh=folder / "mesh.obj", **{**PLAIN, **values}))


@pytest.mark.parametrize("hash_of", [physics_hash, appearance_hash, whole_hash])
def test_the_hash_of_a_model_is_the_same_in_another_folder(tmp_path, hash_of):
    here, there = model(tmp_path / "here"), model(tmp_path / "a_longer_name")
    assert here.paths != there.paths and hash_of(here) == hash_of(there)


def test_the_hash_of_physics_is_another_for_other_physics(tmp_path):
    plain = physics_hash(model(tmp_path))
    assert physics_hash(model(tmp_path, friction="0.5005")) != plain
    assert physics_hash(model(tmp_path, inner='<geom size="1" mass="0"/>')) != plain
    assert physics_hash(model(tmp_path, named='margin="0.01"')) != plain
    faster = model(tmp_path)
    faster.opt.timestep *= 2
    assert physics_hash(faster) != plain
    bent = model(tmp_path)
    bent.mesh_vert[0] += 0.01
    assert physics_hash(bent) != plain


@pytest.mark.parametrize("what", LOOKS)
def test_looks_change_the_hash_of_appearance_alone(tmp_path, what):
    plain, other = model(tmp_path), model(tmp_path, **LOOKS[what])
    assert physics_hash(other) == physics_hash(plain)
    assert appearance_hash(other) != appearance_hash(plain)


def test_names_and_last_digits_do_not_change_the_hash_of_physics(tmp_path):
    plain, other = model(tmp_path), model(tmp_path)
    renamed = mujoco.MjModel.from_xml_string(
        SCENE.format(mesh=tmp_path / "mesh.obj", **PLAIN).replace('"b"', '"body"').replace('"m"', '"mesh"')
    )
    assert physics_hash(renamed) == physics_hash(plain)
    other.body_inertia[:] *= 1 + 1e-15
    assert physics_hash(other) == physics_hash(plain)


class Renamed(points.At):
    """`points.At` under another name."""


def test_the_hash_of_a_task_is_of_its_values_and_not_of_names_of_classes(monkeypatch):
    task = ACTIVITIES["CookingMeat"]
    before = task_hash(task, "humanoid")
    monkeypatch.setitem(KINDS, Renamed, "at")
    distances = tuple(
        tuple(Renamed(p.object, p.above) if isinstance(p, points.At) else p for p in pair) for pair in task.distances
    )
    assert any(isinstance(p, Renamed) for pair in distances for p in pair)
    assert task_hash(dataclasses.replace(task, distances=distances), "humanoid") == before

    @dataclasses.dataclass(frozen=True)
    class Errand(type(task)):
        added: int = 0

    same = Errand(**{f.name: getattr(task, f.name) for f in dataclasses.fields(task)})
    assert task_hash(same, "humanoid") == before, "another class, with a field more that has its default"
    assert task_hash(dataclasses.replace(task, name="Frying", summary="Fry.", home="oak"), "humanoid") == before
    fitted = dataclasses.replace(task, fit=Fit("table_0", ("desk",)))
    assert task_hash(fitted, "humanoid") == before, "what it needs of other homes"
    assert (
        task_hash(dataclasses.replace(task, robots={**task.robots, "own": task.robots["fetch"]}), "humanoid") == before
    )
    assert task_hash(dataclasses.replace(task, goal="open(fridge_0)"), "humanoid") != before
    assert task_hash(task, "fetch") != before
    at, water = (dataclasses.replace(task, distances=((kind("sink_0"),) * 2,)) for kind in (points.At, points.Water))
    assert task_hash(at) != task_hash(water)


def test_renaming_an_object_changes_nothing_and_exchanging_two_does():
    task = ACTIVITIES["CookingMeat"]
    names = ("stove_0", "steak_0", "fridge_0")
    before = task_hash(task, "humanoid", names)
    text = {f.name: getattr(task, f.name) for f in dataclasses.fields(task)}
    renamed = dataclasses.replace(task, **_with(text, "steak_0", "meat_0"))
    assert task_hash(renamed, "humanoid", ("stove_0", "meat_0", "fridge_0")) == before
    assert task_hash(task, "humanoid", ("steak_0", "stove_0", "fridge_0")) != before


def _with(value, old, new) -> Any:
    if isinstance(value, str):
        return value.replace(old, new)
    if isinstance(value, tuple):
        return tuple(_with(v, old, new) for v in value)
    if isinstance(value, dict):
        return {k: _with(v, old, new) for k, v in value.items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.replace(value, **_with(vars(value), old, new))
    return value


def test_every_class_that_tasks_are_made_of_has_a_word_of_its_own():
    classes = [*typing.get_args(points.Point), *logic.Expression.__subclasses__()]
    assert set(classes) <= set(KINDS) and len(set(KINDS.values())) == len(KINDS)


def test_every_kind_of_task_has_a_hash():
    meal, *others = [bddl_task(name) for name in ("cleaning_up_after_a_meal", "putting_away_toys")]
    tasks = [*ACTIVITIES.values(), load_task("PointNavigation"), load_task("Reaching"), meal, *others]
    assert len({task_hash(task) for task in tasks}) == len(tasks)
    assert task_hash(meal) == task_hash(bddl_task("cleaning_up_after_a_meal"))
