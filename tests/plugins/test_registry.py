"""Names of plug-ins are known without their code, clashes are refused, and every error is one line with a way out."""

from __future__ import annotations

import importlib.metadata
import os
import subprocess
import sys
import types

import numpy as np
import pytest

import ig2mj
from ig2mj import cli
from ig2mj.errors import PluginError, UnknownNameError
from ig2mj.plugins import KINDS, VARIABLE, Plugin, entry_points, named_files, registry_of
from ig2mj.predicates import Predicate, find
from ig2mj.sensors import Sensor, Space
from ig2mj.states import StateSpec, registry
from ig2mj.states.spec import given_from_outside as UNCHANGED

AGE = StateSpec.of_objects("age", float, 0.0, UNCHANGED, abilities=None, aliases=("years",))
OLD = Predicate.of_states(lambda model, states: states.age > 1.0, name="old", aliases=("ancient",))
BLANK = Sensor("blank", "nothing", "none", lambda setup: Space((1,), np.float32, 0, 0), lambda s, p: p.view.time)

pytestmark = pytest.mark.usefixtures("registered")


@pytest.fixture
def installs(monkeypatch):
    """Entry points as of installed packages: (name, target, package)."""
    module = types.ModuleType("of_a_package")
    for name, thing in {"AGE": AGE, "OLD": OLD, "BLANK": BLANK, "seven": 7, "run": lambda: print("ran")}.items():
        setattr(module, name, thing)
    monkeypatch.setitem(sys.modules, "of_a_package", module)

    def install(*points: tuple[str, str, str]) -> None:
        found = [Plugin(*name.partition(".")[::2], target, package, "1.0", "ages") for name, target, package in points]
        monkeypatch.setattr(entry_points, "_every", lambda: tuple(found))

    monkeypatch.delenv(VARIABLE, raising=False)
    return install


def test_what_is_registered_is_found_by_name_and_alias():
    ig2mj.register(states=[AGE], predicates=[OLD], sensors=[BLANK])
    assert registry.find("Age") is registry.find("years") is AGE
    assert find("old") is find("ancient") is OLD
    assert registry_of("sensor")["blank"] is BLANK
    assert registry_of("state").sources() == {"age": f"module {__name__}"}


def test_things_of_installed_packages_are_listed_without_being_imported(installs):
    installs(("state.age", "of_no_package:AGE", "ageing"), ("predicate.old", "of_no_package:OLD", "ageing"))
    assert "age" in registry_of("state") and "old" in list(registry_of("predicate"))
    assert registry_of("state").sources() == {"age": "ageing 1.0"}
    assert registry.find("temperature").name == "temperature"


def test_things_of_installed_packages_are_imported_when_they_are_used(installs):
    installs(("state.age", "of_a_package:AGE", "ageing"), ("predicate.old", "of_a_package:OLD", "ageing"))
    assert registry.find("years") is AGE and find("ancient") is OLD


def test_a_command_of_a_package_runs_and_is_listed(installs, capsys):
    installs(("command.grow", "of_a_package:run", "ageing"))
    assert cli.call(["grow"]) == 0 and capsys.readouterr().out == "ran\n"
    assert cli.call(["--help"]) == 0
    assert "grow         ages (ageing 1.0)" in capsys.readouterr().out


def test_a_command_may_have_commands_itself(capsys):
    ig2mj.register(commands={"grow": {"old": lambda: print("old")}})
    assert cli.call(["grow", "old"]) == 0 and capsys.readouterr().out == "old\n"
    assert cli.call(["grow", "young"]) == 2 and "'young' is not a command of 'ig2mj grow'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("expected", "line"),
    [
        ({"states": [OLD]}, "state 'old': register an ig2mj.states.StateSpec, not Predicate"),
        ({"sensors": [7]}, r"sensor '\?': register an ig2mj.sensors.Sensor, not 7"),
        ({"commands": {"Grow": print}}, "command 'Grow': names of this kind are"),
        ({"commands": {"train": print}}, "command 'train' of .*: the name 'train' is taken by ig2mj; rename it"),
        ({"robots": {"fetch": print}}, "the name 'fetch' is taken by ig2mj"),
        ({"overlays": {"o": None}}, "register a class or function that makes an ig2mj.viewer.overlays.Overlay"),
        (
            {"states": [StateSpec.of_objects("heat", float, 0, UNCHANGED, abilities=None, aliases=("toggled",))]},
            "the name 'toggled' is taken by ig2mj",
        ),
        (
            {"states": [StateSpec.of_objects("press_count", float, 0, UNCHANGED, abilities=None)]},
            "the name 'press_count' is taken by ig2mj",
        ),
    ],
)
def test_what_does_not_fit_or_clashes_is_refused(expected, line):
    with pytest.raises(PluginError, match=line):
        ig2mj.register(**expected)


def test_all_of_a_call_is_registered_or_nothing():
    with pytest.raises(PluginError, match="on_top"):
        ig2mj.register(states=[AGE], predicates=[Predicate.of_states(lambda m, s: s.age > 1, name="on_top")])
    assert "age" not in registry_of("state")


def test_what_was_registered_may_be_replaced_and_ours_may_not():
    ig2mj.register(states=[AGE])
    with pytest.raises(PluginError, match="'age' is taken by module"):
        ig2mj.register(states=[AGE])
    newer = StateSpec.of_objects("age", int, 0, UNCHANGED, abilities=None)
    ig2mj.register(states=[newer], replace=True)
    assert registry.find("age") is newer
    with pytest.raises(PluginError, match="taken by ig2mj"):
        ig2mj.register(predicates=[Predicate.of_states(lambda m, s: s.age > 1, name="open")], replace=True)


@pytest.mark.parametrize(
    ("points", "line"),
    [
        (
            [("state.age", "of_no_package:AGE", "ageing")],
            r"^plug-in 'state.age' of ageing 1.0: of_no_package:AGE cannot be imported: ModuleNotFoundError: "
            r"No module named 'of_no_package'; an ig2mj.states.StateSpec is expected "
            r"\(IG2MJ_PLUGINS=-ageing switches the package off\)$",
        ),
        ([("state.age", "of_a_package:YOUTH", "ageing")], "of_a_package:YOUTH cannot be imported: AttributeError"),
        ([("state.age", "of_a_package:seven", "ageing")], "of_a_package:seven is 7; an ig2mj.states.StateSpec is exp"),
        ([("state.youth", "of_a_package:AGE", "ageing")], "has the name 'age'; name the entry point 'state.age'"),
        ([("state.wetness", "of_a_package:AGE", "ageing")], "the name is taken by ig2mj; rename it"),
        (
            [("state.age", "of_a_package:AGE", "ageing"), ("state.age", "other:AGE", "decay")],
            "'state.age' of decay 1.0: the name is taken by ageing 1.0",
        ),
        ([("stat.age", "of_a_package:AGE", "ageing")], "entry points of the group ig2mj.plugins are named state.NAME"),
        ([("age", "of_a_package:AGE", "ageing")], "plug-in 'age' of ageing 1.0: entry points of the group"),
    ],
)
def test_a_package_at_fault_is_named_with_what_was_expected_and_how_to_do_without(installs, points, line):
    installs(*points)
    with pytest.raises(PluginError, match=line) as found:
        registry_of("state").added()
    assert "switches the package off" in str(found.value) and "\n" not in str(found.value)


def test_packages_are_switched_off_by_name_or_all(installs, monkeypatch):
    installs(("state.age", "of_no_package:AGE", "Age.ing"), ("predicate.old", "of_a_package:OLD", "decay"))
    monkeypatch.setenv(VARIABLE, "-age-ing")
    assert "age" not in registry_of("state") and "old" in registry_of("predicate")
    monkeypatch.setenv(VARIABLE, "none")
    assert "old" not in registry_of("predicate")
    monkeypatch.setenv(VARIABLE, "-ageeing")
    with pytest.raises(UnknownNameError, match=r"no package with plug-ins \(IG2MJ_PLUGINS\) .* near matches: age-ing"):
        registry_of("state").added()


def test_the_command_lists_plug_ins_and_what_is_wrong_with_them(installs, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "240")
    installs(("state.age", "of_a_package:AGE", "ageing"), ("predicate.old", "of_no_package:OLD", "decay"))
    assert cli.call(["plugins", "--json"]) == 1
    out = capsys.readouterr().out
    assert '"works"' in out and "of_no_package:OLD cannot be imported" in out
    monkeypatch.setenv(VARIABLE, "-decay")
    assert cli.call(["plugins"]) == 0
    assert "switched off" in capsys.readouterr().out


@pytest.fixture
def files(monkeypatch, tmp_path):
    """A folder; what is named in the variable is forgotten after the test."""
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setattr(named_files, "_imported", set())
    modules = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - modules:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.mark.parametrize(
    ("text", "said"),
    [("states=[3]", "StateSpec, not 3"), ("commands={'view': print}", "'view' is taken")],
)
def test_a_file_whose_registration_is_refused_is_named(files, capsys, text, said):
    (files / "mine.py").write_text(f"import ig2mj\n\nig2mj.register({text})\n")
    assert cli.call(["--plugin", str(files / "mine.py"), "plugins"]) == 2
    err = capsys.readouterr().err
    assert f"plug-in {files / 'mine.py'}: " in err and said in err and err.count("\n") == 1


def test_a_file_is_a_plug_in_of_one_command(files, capsys):
    (files / "mine.py").write_text(
        "import ig2mj\n\ndef hello(name: str = 'you') -> None:\n    '''Greet.'''\n    print('hello', name)\n\n"
        "ig2mj.register(commands={'hello': hello})\n"
    )
    assert cli.call(["hello", "--name", "all", "--plugin", str(files / "mine.py")]) == 0
    assert capsys.readouterr().out == "hello all\n"
    assert os.environ[VARIABLE] == str(files / "mine.py"), "processes that are started import it as well"
    assert registry_of("command").sources() == {"hello": "module mine"}


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (None, "there is no such file; a Python file or module that calls ig2mj.register is expected"),
        ("1 / 0", "cannot be imported: ZeroDivisionError: division by zero"),
        ("import ig2mj\nig2mj.register(states=[7])", "state '?': register an ig2mj.states.StateSpec, not 7"),
        ("raise SystemExit(3)", "cannot be imported: SystemExit: 3"),
    ],
)
def test_a_file_at_fault_is_one_line(files, text, line, capsys):
    file = files / "wrong.py"
    if text is not None:
        file.write_text(text)
    assert cli.call(["list-envs", "--plugin", str(file)]) == 2
    err = capsys.readouterr().err
    assert line in err and err.count("\n") == 1


def test_plugin_without_a_file_is_an_error(capsys):
    assert cli.call(["list-envs", "--plugin"]) == 2
    assert "--plugin needs a Python file" in capsys.readouterr().err


def test_every_kind_has_its_registry_and_none_knows_a_plug_in_here():
    assert [registry_of(kind).kind for kind in KINDS] == list(KINDS)
    installed = {point.name for point in importlib.metadata.entry_points(group="ig2mj.plugins")}
    assert all(set(registry_of(kind).sources()) <= installed for kind in KINDS)


def test_help_and_import_load_no_code_of_plug_ins():
    code = (
        "import sys, ig2mj; from ig2mj import cli; cli.call(['--help'])\n"
        "heavy = {'jax', 'mujoco', 'numpy'} & set(sys.modules)\nassert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
