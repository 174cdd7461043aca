"""Every code block of README.md and docs/ works: Python runs, commands run or at least parse, expressions parse."""

from __future__ import annotations

import pathlib
import re
import shlex
import unittest.mock

import pytest
from parsed_commands import parse_only

from ig2mj import cli
from ig2mj.predicates.parse import parse
from ig2mj.tasks.registry import REGISTERED

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"(?:<!-- ([\w ]+) -->\n)?^```([\w ]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
GPU = "needs a GPU"

PARSED_ONLY = {
    "ig2mj convert": "needs a dataset or an object of the reader's",
    "ig2mj objects show": "needs an object of the reader's",
    "ig2mj objects add": "needs objects of the reader's",
    "ig2mj evaluate GraspingBook --axes": "takes minutes",
    "ig2mj evaluate CookingMeat --policy": "needs a server of the reader's",
    "ig2mj episodes": "takes a minute; run by tests of its own",
    "ig2mj policies serve": "runs until someone interrupts",
    "ig2mj view": "opens a window",
    "ig2mj play": "opens a window",
    "ig2mj web": "runs until someone interrupts",
    "ig2mj demo": "takes a minute; run by tests of its own",
    "ig2mj activity fetch": "downloads",
    "ig2mj activity list --behavior1k": "needs what `fetch` downloads",
    "ig2mj activity show mine.bddl": "needs a file of the reader's",
    "ig2mj activity sample": "takes half a minute",
    "ig2mj activity show cleaning_windows --pool": "needs what the line before it makes",
    "ig2mj sample-task": "takes minutes",
    "ig2mj list-envs my_tasks.py": "needs a file of the reader's",
    "ig2mj rollout my_tasks.py": "needs a file of the reader's",
    "ig2mj rollout activity/mine.bddl": "needs a file of the reader's",
    "ig2mj evaluate runs/": "needs what the line before it makes",
    "ig2mj warm-up": "compiles for minutes",
    "ig2mj train": "takes minutes, on a GPU",
    "ig2mj rollout PointNavigation --robot": "needs a robot of the reader's",
    "ig2mj robots": "needs a robot of the reader's",
    "ig2mj evaluate policy.npz": "needs a policy of the reader's",
    "ig2mj rollout CookingMeat --agent expert": "samples start states for a minute; run by tests of its own",
    "ig2mj demos": "needs what the lines before it make",
    "ig2mj vr": "waits for a person",
    "ig2mj solve small_home '(inside": "takes a minute; run by tests of its own",
    "ig2mj calibrate": "takes minutes on a CPU",
    "ig2mj homes make": "takes half a minute; run by tests of its own",
    "ig2mj homes tour": "renders thousands of images; run by tests of its own",
    "ig2mj sample my_home": "needs what the line before it makes",
    "ig2mj homes build": "takes minutes; run by `make homes-check`",
    "ig2mj homes images": "needs what the lines before it make",
    "ig2mj homes convert": "takes minutes; run by `make homes-check`",
}
"""Commands that are not run here, but whose arguments must be right; `--image` makes `view` run."""


def blocks(page: pathlib.Path) -> list[tuple[str, str, str]]:
    """(remark before the block, language, text) of every code block of a page."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def commands(text: str) -> list[list[str]]:
    """The words of every command of a shell block; comments are left out and continued lines joined."""
    lines = text.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


LONG = {
    "own_tasks",
    "demonstrations",
    "environments",
    "experts",
    "sensors",
    "batches",
    "sampling",
    "objects",
    "activities",
    "index",
    "README",
    "planning",
    "homes",
    "randomization",
}
"""Pages whose blocks take ten seconds or more together: run by `make test-slow`."""


def cases(pages: list[pathlib.Path]) -> list:
    """The pages as parameters, the long ones marked."""
    return [
        pytest.param(page, id=page.relative_to(ROOT).as_posix(), marks=[pytest.mark.slow] if page.stem in LONG else [])
        for page in pages
    ]


def ids(pages: list[pathlib.Path]) -> list[str]:
    return [page.relative_to(ROOT).as_posix() for page in pages]


OF_THEIR_OWN = {"own_homes"}
"""Pages whose Python is run by tests of its own, since it needs what their commands make."""

with_python = [
    p
    for p in PAGES
    if p.stem not in OF_THEIR_OWN and any(language == "python" and remark != GPU for remark, language, _ in blocks(p))
]
with_python_for_gpu = [p for p in PAGES if any(remark == GPU for remark, _, _ in blocks(p))]
with_commands = [p for p in PAGES if any(language == "sh" for _, language, _ in blocks(p))]


def test_every_block_says_what_it_is():
    unknown = [
        f"{page.relative_to(ROOT)}: {text.splitlines()[0]}"
        for page in PAGES
        for _, language, text in blocks(page)
        if language not in ("python", "sh", "lisp", "text", "json", "toml", "xml")
    ]
    assert not unknown, "\n".join(unknown)
    assert with_python and with_commands


@pytest.mark.usefixtures("registered")  # pages register robots and states
@pytest.mark.parametrize("page", cases(with_python))
def test_the_python_of_a_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with unittest.mock.patch.dict(REGISTERED):  # pages register tasks
        run_python(page, without=GPU)


@pytest.mark.gpu
@pytest.mark.parametrize("page", with_python_for_gpu, ids=ids(with_python_for_gpu))
def test_the_python_of_a_page_runs_on_a_gpu(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_python(page, without="")


def run_python(page: pathlib.Path, without: str) -> None:
    """Runs the blocks in one namespace, so that a later one may use names of an earlier one."""
    names: dict[str, object] = {"__name__": "__main__"}
    source = page.read_text(encoding="utf-8")
    for block in BLOCK.finditer(source):
        remark, language, text = block.groups(default="")
        if language == "python" and remark != (without or None):
            line = source.count("\n", 0, block.start(3))
            exec(compile("\n" * line + text, str(page), "exec"), names)


@pytest.mark.parametrize("page", cases(with_commands))
def test_the_commands_of_a_page_run_or_parse(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for _, language, text in blocks(page):
        if language != "sh":
            continue
        for words in commands(text):
            line = shlex.join(words)
            if words[0] == "make":
                assert set(words[1:]) <= targets, line
            elif words[0] == "ig2mj":
                only_parsed = line.startswith(tuple(PARSED_ONLY)) and not ("view" in words and "--image" in words)
                status = parse_only(words[1:], monkeypatch) if only_parsed else cli.call(words[1:])
                assert status == 0, f"{line}\n{capsys.readouterr().err}"
            elif words[:2] in (["python", "benchmarks"], ["python", "-m"]) or words[0] == "pip":
                continue
            else:
                assert words[0] == "python", line
                assert (ROOT / words[1]).is_file(), line


@pytest.mark.parametrize("page", PAGES, ids=ids(PAGES))
def test_the_expressions_of_a_page_parse(page):
    for _, language, text in blocks(page):
        if language == "lisp":
            depth, start = 0, 0
            for place, letter in enumerate(text):
                depth += (letter == "(") - (letter == ")")
                if letter == "(" and depth == 1:
                    start = place
                if letter == ")" and depth == 0:
                    parse(text[start : place + 1])
