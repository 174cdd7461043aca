"""Instructions in plain words."""

import json
import pathlib
import tomllib

import pytest

import ig2mj
from ig2mj import cli
from ig2mj.errors import InputError, UnknownNameError
from ig2mj.planning.domain import Domain
from ig2mj.planning.steps import PRIMITIVES, PlanningError
from ig2mj.planning.symbolic import start_facts
from ig2mj.planning.words import NotUnderstoodError, read_script, script_of, tools, understand
from ig2mj.states.model import StateModel

FILE = pathlib.Path(__file__).parents[2] / "benchmarks" / "planning" / "instructions.toml"
INSTRUCTIONS = {home: v["instructions"] for home, v in tomllib.loads(FILE.read_text()).items()}


def facts_of(home):
    scene = ig2mj.load_scene(home)
    return start_facts(Domain(StateModel.of_manifest(scene.tables, scene.manifest)), scene, None, 0)


@pytest.fixture(scope="module")
def facts():
    return facts_of("small_home")


def as_meant(steps, means):
    expected = [[word.split("|") for word in step.split()] for step in means.split(";")]
    return len(steps) == len(expected) and all(
        len(words) == 1 + len(step.arguments)
        and all(given in any_of for given, any_of in zip((step.primitive, *step.arguments), words, strict=True))
        for step, words in zip(steps, expected, strict=True)
    )


def understood(home, facts):
    """Instructions that are translated as they are meant; each of the others is refused with a quotation."""
    count = 0
    for text, means in INSTRUCTIONS[home]:
        try:
            steps = understand(text, facts).steps
        except NotUnderstoodError as e:
            assert not means or "'" in str(e), text
            continue
        assert means, text
        count += as_meant(steps, means)
    return count


def test_instructions_in_small_home_mean_what_they_say(facts):
    assert understood("small_home", facts) == len(INSTRUCTIONS["small_home"])


@pytest.mark.slow
def test_at_least_ninety_of_a_hundred_instructions_are_understood(facts):
    others = [home for home in INSTRUCTIONS if home != "small_home"]
    count = understood("small_home", facts) + sum(understood(home, facts_of(home)) for home in others)
    assert sum(len(each) for each in INSTRUCTIONS.values()) == 100
    assert count >= 90


def test_the_goal_of_an_instruction_is_what_holds_when_all_is_done(facts):
    found = understand("open the fridge, put the apple in it and close it", facts)
    assert found.goal == "(and (inside apple_0 fridge_0) (not (open fridge_0)))"
    assert understand("pick up the mug", facts).goal is None


def test_a_choice_among_several_objects_is_noted(facts):
    assert understand("push a chair to the table", facts).notes


@pytest.mark.parametrize(
    ("text", "quoted"),
    [
        ("", "empty"),
        ("juggle the apple", "juggle"),
        ("put the aple into the fridge", "apple"),
        ("put it on the table", "'it'"),
        ("open", "ends"),
        ("put five mugs on the table", "there are 1"),
        ("slice the sofa", "sofa_0"),
        ("turn on the apple", "apple_0"),
        ("go to the moon", "moon"),
        ("put the apple", "place"),
        ("apple " * 300, "words"),
    ],
)
def test_what_is_not_understood_is_said(facts, text, quoted):
    with pytest.raises(NotUnderstoodError, match=quoted):
        understand(text, facts)


def test_tools_describe_every_primitive_with_the_names_of_a_scene(facts):
    found = {t["function"]["name"]: t["function"]["parameters"] for t in tools(facts.domain.model.tables)}
    assert found.keys() == PRIMITIVES.keys()
    assert "fridge_0" in found["place_inside"]["properties"]["container"]["enum"]
    assert found["place_on_floor"]["properties"]["room"]["enum"] == ["kitchen_0", "living_room_0"]


def test_a_script_is_read_as_it_is_written(facts, tmp_path):
    steps = understand("slice the apple with the knife and go to the sofa", facts).steps
    (tmp_path / "script.json").write_text(json.dumps(script_of(steps)))
    assert tuple(read_script(tmp_path / "script.json")) == steps


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        ("{}", InputError, "array"),
        ("[1]", InputError, "array"),
        ("nonsense", InputError, "array"),
        ('[{"name": "grap", "arguments": {"object": "a"}}]', UnknownNameError, "grasp"),
        ('[{"name": "grasp", "arguments": {"objct": "a"}}]', UnknownNameError, "object"),
        ('[{"name": "grasp", "argument": {"object": "a"}}]', InputError, "argument"),
        ('[{"name": "grasp"}]', PlanningError, "takes object"),
    ],
)
def test_a_faulty_script_is_refused(tmp_path, text, error, said):
    (tmp_path / "script.json").write_text(text)
    with pytest.raises(error, match=said):
        read_script(tmp_path / "script.json")


@pytest.mark.slow
def test_a_script_is_carried_out_until_a_request_fails(tmp_path, capsys):
    steps = [("grasp", {"object": "apple_0"}), ("grasp", {"object": "sofa_0"}), ("release", {"object": "apple_0"})]
    script = tmp_path / "script.json"
    script.write_text(json.dumps([{"name": name, "arguments": arguments} for name, arguments in steps]))
    assert cli.call(["solve", "small_home", "--script", str(script), "--json"]) == 1
    found = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert found["failures"] == {"grasp": {"no_grasp": 1}}
    assert found["q"] == pytest.approx(1 / 3)
