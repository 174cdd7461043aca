"""Old names of options and sub-commands work, print one line that names the new one, and stand in no help."""

from __future__ import annotations

import importlib
import sys
import types
from typing import Annotated

import pytest
import tyro

from ig2mj import cli
from ig2mj.cli.common.deprecated import renamed_options, renamed_options_of


@pytest.fixture
def probe(monkeypatch):
    module = types.ModuleType("ig2mj.cli.probe")
    monkeypatch.setitem(sys.modules, "ig2mj.cli.probe", module)
    monkeypatch.setitem(cli.COMMANDS, "probe", "try something")
    return module


@pytest.mark.parametrize("words", [["--until", "0.5"], ["--until=0.5"], ["--stop-at-success", "0.5"]])
def test_an_old_option_is_the_new_one(probe, capsys, words):
    @renamed_options({"--until": "--stop-at-success"})
    def run(stop_at_success: float = 1.0) -> None:
        print(stop_at_success)

    probe.run = run
    assert cli.call(["probe", *words]) == 0
    out = capsys.readouterr()
    assert out.out == "0.5\n"
    assert out.err.count("\n") == ("until" in words[0])
    if "until" in words[0]:
        assert out.err == ("ig2mj probe: '--until' is now '--stop-at-success'; the old name will be removed in 0.3\n")


def test_an_old_option_with_an_underscore_is_found_too(probe, capsys):
    @renamed_options({"--begin-with": "--init-from"})
    def run(init_from: str = "") -> None:
        print(init_from)

    probe.run = run
    assert cli.call(["probe", "--begin_with", "x"]) == 0
    assert capsys.readouterr().out == "x\n"


@pytest.mark.parametrize(
    ("words", "settings"),
    [
        (["--mixed", "4"], ("starts=4",)),
        (["--mixed=4", "--set", "lr=1", "batch=2"], ("starts=4", "lr=1", "batch=2")),
        (["--set", "lr=1", "--fast", "--seed", "3"], ("fast=true", "lr=1")),
        (["--fast", "NAME"], ("fast=true",)),
    ],
)
def test_an_old_option_may_become_a_setting(probe, capsys, words, settings):
    @renamed_options({"--mixed": "--set starts=", "--fast": "--set fast=true"})
    def run(name: Annotated[str, tyro.conf.Positional] = "", set: tuple[str, ...] = (), seed: int = 0) -> None:
        print(set)

    probe.run = run
    assert cli.call(["probe", *words]) == 0
    assert capsys.readouterr().out == f"{settings}\n"


def test_an_old_subcommand_is_the_new_one(probe, capsys):
    def images() -> None:
        print("images")

    probe.SUBCOMMANDS, probe.RENAMED = {"images": images}, {"pictures": "images"}
    assert cli.call(["probe", "pictures"]) == 0
    out = capsys.readouterr()
    assert out.out == "images\n"
    assert out.err == "ig2mj probe: 'pictures' is now 'images'; the old name will be removed in 0.3\n"


def functions() -> dict[str, object]:
    """Every command and sub-command, by what one types."""
    found: dict[str, object] = {}
    for name in cli.COMMANDS:
        module = importlib.import_module(f"ig2mj.cli.{name.replace('-', '_')}")
        if hasattr(module, "run"):
            found[name] = module.run
        found |= {f"{name} {sub}": function for sub, function in getattr(module, "SUBCOMMANDS", {}).items()}
    return found


def test_help_shows_the_new_names_only(capsys):
    renamed = {words: renamed_options_of(f) for words, f in functions().items() if renamed_options_of(f)}
    assert {"view", "activity show", "evaluate", "sample-task"} <= set(renamed)
    for words, names in renamed.items():
        assert cli.call([*words.split(), "--help"]) == 0
        text = capsys.readouterr().out
        for old, new in names.items():
            assert f"{old} " not in text, (words, old)
            assert new.split()[0] in text, (words, new)


def test_renamed_subcommands_exist():
    for name in cli.COMMANDS:
        module = importlib.import_module(f"ig2mj.cli.{name.replace('-', '_')}")
        for old, new in getattr(module, "RENAMED", {}).items():
            assert old not in module.SUBCOMMANDS and new in module.SUBCOMMANDS


def test_settings_that_are_given_one_by_one_all_count(probe, capsys):
    def run(set: tuple[str, ...] = (), seed: int = 0) -> None:
        print(set, seed)

    probe.run = run
    assert cli.call(["probe", "--set", "a=1", "b=2", "--seed", "3", "--set", "c=4"]) == 0
    assert capsys.readouterr().out == "('a=1', 'b=2', 'c=4') 3\n"
