"""Commands that messages name can be pasted into a shell."""

from __future__ import annotations

import pathlib
import re
import shlex

from ig2mj.files.shell import command

SOURCE = pathlib.Path(__file__).resolve().parents[2] / "src" / "ig2mj"


def test_names_with_spaces_are_quoted():
    words = ["view", "my home", "--pool", pathlib.Path("a b/c's.npz")]
    assert shlex.split(command(*words)) == ["ig2mj", *map(str, words)]
    assert command("view", "small_home") == "ig2mj view small_home"


def test_no_message_puts_a_path_into_a_command_unquoted():
    paths = re.compile(r"ig2mj(?: -*[A-Za-z-]+)+ \{[a-z_.]*(?:file|path|out|folder|dir|pool|scene)\}")
    for file in SOURCE.rglob("*.py"):
        assert not (found := paths.search(file.read_text(encoding="utf-8"))), (file, found)
