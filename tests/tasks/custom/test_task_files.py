"""Tasks of a user's file: found by file and name, bad ones refused in one line that names the file."""

from __future__ import annotations

import os
import pathlib
import pickle
import shutil

import pytest
from own_tasks import APPLE, write_task

import ig2mj
from ig2mj.envs.names import refuse_path, short_name
from ig2mj.envs.registry import find_task, list_envs
from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.custom.checks import checked_names
from ig2mj.tasks.custom.code import NOTEBOOK
from ig2mj.tasks.custom.files import VARIABLE, import_file, registered_of, use_task
from ig2mj.tasks.pools import starts_digest
from ig2mj.tasks.registry import REGISTERED, split_reference
from ig2mj.tasks.task import Task


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """No task of one test is known in another."""
    monkeypatch.setenv(VARIABLE, "")
    before = dict(REGISTERED)
    REGISTERED.clear()
    yield
    REGISTERED.clear()
    REGISTERED.update(before)


@pytest.fixture
def file(tmp_path, tiny_home_folder) -> pathlib.Path:
    return write_task(tmp_path, tiny_home_folder)


def error_of(call) -> str:
    """The one line that the command prints."""
    with pytest.raises((InputError, UnknownNameError)) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text
    return text


def with_line(file: pathlib.Path, old: str, new: str) -> str:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    return f"{file}:AppleToFloor"


@pytest.mark.parametrize(
    ("name", "split"),
    [
        ("my_tasks.py:Mug", ("my_tasks.py", "Mug")),
        ("C:\\tasks\\mine.py:Mug", ("C:\\tasks\\mine.py", "Mug")),
        ("folder/my.py", ("folder/my.py", "")),
        ("CookingMeat", None),
        ("activity/mine.bddl", None),
        ("ig2mj/CookingMeat-v0", None),
    ],
)
def test_a_reference_is_a_python_file_and_a_name(name, split):
    assert split_reference(name) == split


def test_a_class_of_a_file_is_a_task(file, tiny_home_folder):
    task = find_task(f"{file}:AppleToFloor")
    assert isinstance(task, Task)
    assert (task.name, task.summary, task.horizon) == ("AppleToFloor", "Put the apple on the floor.", 20)
    assert task.home == str(tiny_home_folder) and task.objects_of_interest == ("apple",)
    assert task.robots["humanoid"].pos == (0.0, -1.0) and task.robots["humanoid"].hands == (1,)
    assert task.code is not None and task.code.has_functions and task.code.file == str(file.resolve())


def test_it_is_then_known_by_its_bare_name(file):
    task = find_task(f"{file}:AppleToFloor")
    assert find_task("AppleToFloor") is find_task("ig2mj/AppleToFloor-v0") is task
    assert short_name("AppleToFloor") == "AppleToFloor" and list_envs()[-1] == "AppleToFloor"


def test_gymnasium_knows_it_by_name_and_file(file):
    gymnasium = pytest.importorskip("gymnasium")
    text = file.read_text().replace("class AppleToFloor", "@ig2mj.register_task\nclass AppleForGymnasium")
    file.write_text(text)
    find_task(f"{file}:AppleForGymnasium")
    spec = gymnasium.registry.pop("ig2mj/AppleForGymnasium-v0")
    assert spec.kwargs == {"task": f"{file.resolve()}:AppleForGymnasium"}


def test_a_file_of_the_variable_is_known_by_name(file, monkeypatch):
    with pytest.raises(UnknownNameError):
        find_task("AppleToFloor")
    monkeypatch.setenv(VARIABLE, str(file))
    assert find_task("AppleToFloor").name == "AppleToFloor"


def test_use_task_names_the_file_to_processes_that_follow(file):
    use_task(f"{file}:AppleToFloor")
    assert os.environ[VARIABLE] == str(file.resolve())


def test_functions_and_tasks_define_tasks_too(tmp_path, tiny_home_folder):
    text = """
    import dataclasses
    import ig2mj
    from ig2mj.tasks.navigation.task import POINT_NAVIGATION

    @ig2mj.register_task
    def Near():
        return dataclasses.replace(POINT_NAVIGATION, target_dist=(1.0, 2.0))

    FAR = dataclasses.replace(POINT_NAVIGATION, target_dist=(5.0, 9.0))

    class Paid(ig2mj.CustomTask):
        base = "PointNavigation"
        horizon = 30
        home = "elm"

        def reward(self, world):
            return world.zeros()
    """
    file = write_task(tmp_path, tiny_home_folder, text)
    found = {known.name: known.task for known in registered_of(str(file))}
    assert list(found) == ["Near", "FAR", "Paid"]
    assert found["Near"].target_dist == (1.0, 2.0) and found["FAR"].name == "FAR"
    assert (found["Paid"].horizon, found["Paid"].home) == (30, "elm")
    assert found["Paid"].code.reward is not None and found["Near"].code.reward is None


def test_what_a_file_defines_is_pickled_by_name(file):
    task = find_task(f"{file}:AppleToFloor")
    again = pickle.loads(pickle.dumps(task.code))
    assert again.digest == task.code.digest and again.name == "AppleToFloor"
    with_line(file, "horizon = 20", "horizon = 30")
    pickled = pickle.dumps(task.code)
    with pytest.raises(InputError, match="has changed"):
        pickle.loads(pickled)


def test_a_class_itself_can_be_made_a_task(tiny_home_folder):
    class Here(ig2mj.CustomTask):
        home = str(tiny_home_folder)
        goal = "(on_floor apple kitchen_0)"
        robots = ("humanoid",)

    assert ig2mj.default_config(Here).robot == "humanoid"
    assert ig2mj.default_config(Here).grasping == "assisted"


# What determines a task.


def digest_after(file: pathlib.Path, old: str, new: str) -> str:
    return find_task(with_line(file, old, new)).code.digest


def test_comments_and_other_tasks_do_not_change_what_determines_it(file):
    before = find_task(f"{file}:AppleToFloor").code.digest
    assert digest_after(file, "    goal =", "    # the goal\n    goal  =") == before
    assert digest_after(file, '"""Put the apple on the floor."""', '"""Apple, go."""') == before
    assert digest_after(file, "class AppleToFloor", "OTHER = 5\n\n\nclass AppleToFloor") == before


def test_what_it_names_in_its_file_and_folder_does(file):
    before = find_task(f"{file}:AppleToFloor").code.digest
    scaled = digest_after(file, "class AppleToFloor", "SCALE = 2.0\n\n\nclass AppleToFloor")
    assert scaled == before
    scaled = digest_after(file, "-0.01 *", "-SCALE *")
    assert scaled != before
    assert digest_after(file, "SCALE = 2.0", "SCALE = 3.0") != scaled
    helper = file.with_name("helper_of_mine.py")
    helper.write_text("def scale():\n    return 1.0\n")
    imported = digest_after(file, "SCALE = 3.0", "from helper_of_mine import scale\nSCALE = scale()")
    helper.write_text("def scale():\n    return 4.0\n")
    assert digest_after(file, "Tasks of a user's", "Tasks") != imported


# Bad input.


def test_a_file_that_is_not_there_or_not_python_is_refused(tmp_path):
    assert "there is no such file" in error_of(lambda: find_task(str(tmp_path / "gone.py:Mug")))
    broken = tmp_path / "broken.py"
    broken.write_text("class Mug(:\n")
    assert "broken.py: line 1: is not Python" in error_of(lambda: find_task(f"{broken}:Mug"))


def test_what_a_file_raises_is_named_with_its_line(tmp_path):
    file = tmp_path / "raises.py"
    file.write_text("x = 1\n\ny = 1 / 0\n")
    text = error_of(lambda: find_task(f"{file}:Mug"))
    assert "raises.py: line 3: cannot be imported: ZeroDivisionError: division by zero" in text
    file.write_text("import tourch_that_is_not_there\n")
    assert "imports 'tourch_that_is_not_there', which is not installed" in error_of(lambda: find_task(f"{file}:Mug"))


def test_the_cause_has_the_traceback(tmp_path):
    file = tmp_path / "raises.py"
    file.write_text("y = 1 / 0\n")
    with pytest.raises(InputError) as caught:
        find_task(f"{file}:Mug")
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


def test_a_class_that_is_not_there_is_refused_with_those_that_are(file):
    assert "near matches: AppleToFloor" in error_of(lambda: find_task(f"{file}:AppleToFlor"))
    assert f"name one: {file}:AppleToFloor" in error_of(lambda: find_task(str(file)))


GOAL, PLACE = 'goal = "(on_floor apple kitchen_0)"', '"humanoid": (0.0, -1.0, 90.0)'


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("class AppleToFloor(ig2mj.CustomTask)", "class AppleToFloor", "derive it from ig2mj.CustomTask"),
        (GOAL, "", "has neither a goal nor a method `success`"),
        (
            'goal = "(on_floor apple kitchen_0)"',
            'goals = "(x y)"',
            "AppleToFloor.goals: is no setting of a task ('goal'?)",
        ),
        (
            'goal = "(on_floor apple kitchen_0)"',
            'goal = "(on_floor apple"',
            "AppleToFloor.goal: expression: ends too early",
        ),
        ("horizon = 20", 'horizon = "20"', "AppleToFloor.horizon: is of type str: int is expected"),
        (
            '"humanoid": (0.0, -1.0, 90.0)',
            '"humanoidd": (0.0, -1.0)',
            "AppleToFloor.robots: no robot is named 'humanoidd'",
        ),
        (PLACE, '"humanoid": 5.0', "AppleToFloor.robots['humanoid']: (x, y)"),
        ("horizon = 20", 'objects = ("mugg",)', "AppleToFloor.objects: "),
        ("horizon = 20", "objects = 5", "AppleToFloor.objects: a list of texts is expected"),
        ("horizon = 20", 'base = "PointNavigatio"', "AppleToFloor.base: no task is named 'PointNavigatio'"),
    ],
)
def test_a_definition_that_cannot_be_is_refused(file, old, new, said):
    text = error_of(lambda: find_task(with_line(file, old, new)))
    assert said in text and "my_tasks.py" in text


def test_a_name_that_clashes_is_refused(file, tmp_path, tiny_home_folder):
    text = APPLE.replace("AppleToFloor", "CookingMeat")
    other = write_task(tmp_path, tiny_home_folder, text, "clash.py")
    assert "clash.py: CookingMeat: a task of ig2mj has this name" in error_of(lambda: find_task(f"{other}:CookingMeat"))
    find_task(f"{file}:AppleToFloor")
    again = write_task(tmp_path, tiny_home_folder, name="again.py")
    assert "my_tasks.py defines a task of this name, too" in error_of(lambda: find_task(f"{again}:AppleToFloor"))


def test_a_changed_file_is_imported_again(file):
    assert find_task(f"{file}:AppleToFloor").horizon == 20
    assert find_task(with_line(file, "horizon = 20", "horizon = 25")).horizon == 25
    assert find_task("AppleToFloor").horizon == 25
    assert import_file(file) is import_file(file)


def test_other_files_cannot_name_code():
    for name in ("my_tasks.py:Mug", "/tmp/evil.py:X", "evil.py"):
        with pytest.raises(InputError, match="is the path of a file"):
            refuse_path(name, "runs.h5", "attribute task")


def test_tasks_that_ship_have_no_code():
    assert all(task.code is None for task in ACTIVITIES.values())
    assert NOTEBOOK not in list_envs()


def test_the_bddl_definition_of_the_guide_is_an_environment_and_a_base(tmp_path, tiny_home_folder, repository):
    page = (repository / "docs" / "guide" / "activities.md").read_text()
    text = page[page.index("(define (problem mine_0)") :]
    (tmp_path / "mine.bddl").write_text(text[: text.index("```")])
    task = find_task(f"activity/{tmp_path / 'mine.bddl'}")
    assert (task.name, task.code.in_files["task_file"]) == ("activity/mine", "mine.bddl")
    with pytest.raises(UnknownNameError):
        find_task("activity/mine")
    use_task(f"activity/{tmp_path / 'mine.bddl'}")
    assert find_task("activity/mine").binding == task.binding
    based = """
    import ig2mj

    class Mine(ig2mj.CustomTask):
        base = "activity/mine.bddl"

        def reward(self, world):
            return world.goal.fraction
    """
    own = find_task(f"{write_task(tmp_path, tiny_home_folder, based, 'based.py')}:Mine")
    assert own.binding == task.binding and own.name == "Mine" and own.code.reward is not None


def test_a_training_stops_at_a_reward_that_is_not_finite():
    from ig2mj.learn.train import _guard_rewards

    _guard_rewards({"reward": 1.0, "reward/a": 2.0, "return": float("nan")}, None)
    with pytest.raises(Ig2mjError, match=r"my_tasks\.py: training stopped: the reward's term 'a' is nan"):
        _guard_rewards({"reward/a": float("nan")}, "my_tasks.py")


def test_an_object_from_a_folder_next_to_the_file_takes_part(tmp_path, tiny_home_folder, cup):
    shutil.copytree(cup, tmp_path / "cup")
    text = """
    import ig2mj

    class CupToFloor(ig2mj.CustomTask):
        home = "{home}"
        objects = ("cup@on_top:table",)
        goal = "(on_floor cup_0 kitchen_0)"
        robots = ("humanoid",)
    """
    task = find_task(f"{write_task(tmp_path, tiny_home_folder, text)}:CupToFloor")
    assert task.objects == (str(tmp_path / "cup"),) and task.start == ("(on_top cup_0 table)",)
    assert checked_names(task).objects_of_interest == ("cup_0",)
    before = starts_digest(task)
    shutil.copytree(tmp_path, tmp_path.parent / "moved")
    REGISTERED.clear()
    moved = find_task(f"{tmp_path.parent / 'moved' / 'my_tasks.py'}:CupToFloor")
    assert starts_digest(moved) == before and moved.code.digest == task.code.digest
