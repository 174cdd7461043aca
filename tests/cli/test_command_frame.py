"""The command `ig2mj`: statuses, one-line errors, near names, and help that loads nothing heavy."""

from __future__ import annotations

import importlib.metadata
import json
import pathlib
import resource
import subprocess
import sys
import types

import pytest
from PIL import Image

from ig2mj import cli
from ig2mj.errors import Ig2mjError, InputError

HEAVY = {"jax", "mujoco", "coacd", "trimesh", "warp", "scipy", "ig2mj_converters", "ig2mj_homes"}


@pytest.fixture
def command(monkeypatch):
    """Registers a sub-command `probe` whose body is the given function."""

    def register(function=None, **subcommands):
        module = types.ModuleType("ig2mj.cli.probe")
        if function is not None:
            module.run = function
        if subcommands:
            module.SUBCOMMANDS = subcommands
        monkeypatch.setitem(sys.modules, "ig2mj.cli.probe", module)
        monkeypatch.setitem(cli.COMMANDS, "probe", "try something")

    return register


def test_a_user_error_is_one_line_on_stderr_and_status_2(command, capsys):
    def run() -> None:
        raise InputError("a.urdf", "has no\nlinks", element="robot", fix="add one")

    command(run)
    assert cli.call(["probe"]) == 2
    out = capsys.readouterr()
    assert out.err == "error: a.urdf: robot: has no links (add one)\n"
    assert out.out == ""


@pytest.mark.parametrize("argv", [["--debug", "probe"], ["probe", "--debug"]])
def test_debug_lets_the_traceback_through(command, argv):
    def run() -> None:
        raise InputError("a.urdf", "is broken")

    command(run)
    with pytest.raises(Ig2mjError):
        cli.call(argv)


def test_an_interrupt_is_status_130(command, capsys):
    def run() -> None:
        raise KeyboardInterrupt

    command(run)
    assert cli.call(["probe"]) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_an_error_of_ig2mj_itself_is_status_1_and_no_traceback(command, capsys):
    def run() -> None:
        raise ZeroDivisionError("by zero")

    command(run)
    assert cli.call(["probe"]) == 1
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "ZeroDivisionError: by zero" in line
    assert "--debug" in line


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("train --num-envs 8", "there is no option --num-envs; the option is --worlds"),
        ("rollout --env CookingMeat", "ENV is positional, as in `ig2mj rollout ENV`"),
        ("convert --urdf x.urdf", "(a URDF: `ig2mj convert object --urdf FILE`,"),
        ("inspect x.urdf", "is a URDF, not a converted scene"),
        ("states small_home --set toggeld_on=stove_0", "near matches: toggled_on\n"),
    ],
)
def test_what_a_new_user_types_is_answered_with_what_to_type(capsys, words, said):
    assert cli.call(words.split()) == 2
    assert said in capsys.readouterr().err


def test_a_missing_package_names_the_command_that_installs_it(command, capsys):
    def run() -> None:
        raise ModuleNotFoundError("No module named 'coacd'", name="coacd")

    command(run)
    assert cli.call(["probe"]) == 2
    assert '[convert]"' in capsys.readouterr().err


def test_a_file_that_cannot_be_written_is_status_2_and_named(command, capsys):
    def run() -> None:
        raise PermissionError(13, "Permission denied", "/x/out.png")

    command(run)
    assert cli.call(["probe"]) == 2
    assert capsys.readouterr().err == "error: /x/out.png: Permission denied\n"


@pytest.mark.parametrize("status", [0, 1, 3])
def test_what_a_command_returns_is_the_status(command, status):
    def run() -> int:
        return status

    command(run)
    assert cli.call(["probe"]) == status


def test_a_command_that_returns_nothing_is_status_0(command):
    def run() -> None:
        pass

    command(run)
    assert cli.call(["probe"]) == 0


def test_typed_parameters_are_the_command_line(command, capsys):
    def run(number: int, fast: bool = False) -> None:
        print(number + 1, fast)

    command(run)
    assert cli.call(["probe", "--number", "4", "--fast"]) == 0
    assert capsys.readouterr().out == "5 True\n"
    assert cli.call(["probe", "--number", "four"]) == 2
    assert cli.call(["probe"]) == 2
    assert cli.call(["probe", "--number", "4", "--slow"]) == 2


def test_help_tells_defaults_but_not_those_that_say_nothing(command, capsys):
    def run(file: pathlib.Path | None = None, names: tuple[str, ...] = (), fast: bool = False, number: int = 7) -> None:
        """Does it."""

    command(run)
    assert cli.call(["probe", "--help"]) == 0
    out = capsys.readouterr().out
    assert out.count("(default") == 1 and "(default: 7)" in out
    assert "None" not in out and "--file PATH" in out


def test_a_help_text_is_folded_anew_wherever_its_source_breaks_lines(command, capsys):
    def run(number: int = 7, other: int = 8) -> None:
        """Does it.

        Args:
          number: at most
            15 of them (see
            there).
          other: one
            more.
        """

    command(run)
    assert cli.call(["probe", "--help"]) == 0
    out = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "at most 15 of them (see there). (default: 7)" in out and "one more. (default: 8)" in out


def test_nested_commands_are_found_listed_and_corrected(command, capsys):
    def scene(name: str = "a") -> None:
        """Does a scene."""
        print("scene", name)

    command(scene=scene, thing=lambda: None)
    assert cli.call(["probe", "scene", "--name", "b"]) == 0
    assert capsys.readouterr().out == "scene b\n"
    assert cli.call(["probe", "--help"]) == 0
    assert "Does a scene." in capsys.readouterr().out
    assert cli.call(["probe", "scen"]) == 2
    assert "did you mean scene?" in capsys.readouterr().err
    assert cli.call(["probe"]) == 2


def test_an_unknown_command_suggests_near_ones(capsys):
    assert cli.call(["doktor"]) == 2
    assert capsys.readouterr().err == "error: 'doktor' is not a command (did you mean doctor?)\n"
    assert cli.call(["zzzz"]) == 2
    assert "`ig2mj --help` lists them" in capsys.readouterr().err


def test_version_is_that_of_the_package(capsys):
    assert cli.call(["--version"]) == 0
    assert capsys.readouterr().out.split() == ["ig2mj", importlib.metadata.version("ig2mj")]


def test_help_lists_every_command(capsys):
    assert cli.call(["--help"]) == 0
    out = capsys.readouterr().out
    assert all(len(line) < 80 for line in out.splitlines())
    assert all(f"  {name} " in out and text in " ".join(out.split()) for name, text in cli.COMMANDS.items())


def test_no_arguments_give_the_help_and_status_2(capsys):
    assert cli.call([]) == 2
    assert "commands:" in capsys.readouterr().out


def run_help(*argv: str) -> tuple[set[str], float, subprocess.CompletedProcess]:
    """Heavy modules that the command line loads, its processor seconds, and the finished process."""
    code = (
        "import json, sys; from ig2mj import cli; status = cli.call(sys.argv[1:]); "
        "print(json.dumps(sorted({m.split(chr(46))[0] for m in sys.modules})), file=sys.stderr); sys.exit(status)"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-c", code, *argv], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    loaded = set(json.loads(done.stderr.splitlines()[-1]))
    return loaded & HEAVY, (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime), done


def test_help_takes_less_than_a_second_and_loads_nothing_heavy():
    heavy, seconds, done = run_help("--help")
    assert done.returncode == 0
    assert not heavy
    assert seconds < 1.0


def test_every_command_exists_and_its_help_loads_no_engine():
    """One process for all of them: what one loads would be there for the next, too, and the first is named."""
    code = (
        "import contextlib, io, json, sys; from ig2mj import cli\n"
        "for name in sys.argv[1:]:\n"
        "    with contextlib.redirect_stdout(io.StringIO()) as out: status = cli.call([name, '--help'])\n"
        "    print(json.dumps([name, status, out.getvalue(), sorted({m.split('.')[0] for m in sys.modules})]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code, *cli.COMMANDS], capture_output=True, text=True)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [name for name, *_ in rows] == list(cli.COMMANDS), done.stderr
    for name, status, text, loaded in rows:
        assert status == 0 and f"usage: ig2mj {name}" in text, name
        assert not set(loaded) & {"jax", "mujoco", "coacd", "warp"}, name


def test_output_cut_off_by_head_is_no_error(tmp_path):
    code = "from ig2mj import cli; import sys; sys.exit(cli.call(['--help']))"
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert b"Traceback" not in process.stderr.read()


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_a_stream_that_the_shell_closed_is_no_error(closed):
    code = f"import sys; sys.{closed} = None; from ig2mj import cli; cli.main(['--help'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_after_ctrl_c_no_library_is_torn_down():
    """XLA crashes there while a program is compiled, and status 139 would stand for what the user asked for."""
    code = (
        "import atexit, os; from ig2mj import cli; atexit.register(os._exit, 139)\n"
        "def interrupted(args): raise KeyboardInterrupt\n"
        "cli._dispatch = interrupted; cli.main(['train'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


@pytest.mark.skipif(not pathlib.Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_names_the_file_that_was_written(tmp_path, monkeypatch, capsys):
    """The error of a write has no file name of its own."""
    page = tmp_path / "page.html"
    page.symlink_to("/dev/full")
    picture = tmp_path / "picture.png"
    picture.symlink_to("/dev/full")

    def write_page(scene: pathlib.Path) -> None:
        page.write_text("text")

    def write_picture(scene: pathlib.Path, file: pathlib.Path) -> None:
        Image.new("RGB", (64, 64)).save(file)

    for work, file in ((lambda: write_page(tmp_path), page), (lambda: write_picture(tmp_path, picture), picture)):
        monkeypatch.setattr(cli, "_dispatch", lambda _, work=work: work())
        assert cli.call(["view"]) == 2
        assert capsys.readouterr().err == f"error: {file}: No space left on device\n"


def test_a_seed_below_zero_is_refused_before_the_command_begins(command, capsys):
    def run(seed: int = 0) -> None:
        raise AssertionError(f"began with seed {seed}")

    command(run)
    assert cli.call(["probe", "--seed", "-1"]) == 2
    assert capsys.readouterr().err == "error: --seed -1: a seed is at least 0\n"


def test_values_of_an_option_that_is_given_twice_add_up(command):
    found = []

    def run(*, set: tuple[str, ...] = (), worlds: int = 1) -> None:
        found.append((set, worlds))

    command(run)
    assert cli.call(["probe", "--set", "a=1", "b=2", "--worlds", "4", "--set=c=3", "--set", "d=4"]) == 0
    assert found == [(("a=1", "b=2", "c=3", "d=4"), 4)]
