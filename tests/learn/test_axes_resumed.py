"""Evaluations on axes keep what is over: on disk, after Ctrl-C, and where a policy server fails."""

from __future__ import annotations

import concurrent.futures
import json
import weakref

import numpy as np
import pytest

from ig2mj.cli.common.axes import Output, play_axes
from ig2mj.cluster.journal import MemoryStore
from ig2mj.errors import InputError, PolicyServerError
from ig2mj.learn.axes import AxisResult, Batch, _ready, batches_of, evaluate_axes, result_of
from ig2mj.learn.episodes import EpisodePart, Episodes, find_episodes
from ig2mj.process.together import TOGETHER

OPTIONS = {"engine": "native", "worlds": 2, "horizon": 2, "observations": "proprioception"}
AXES = ("nominal", "sensor_noise", "lights")


@pytest.fixture(scope="module")
def book() -> Episodes:
    return Episodes.load(find_episodes("GraspingBook"))


class Resting:
    """Agents that do nothing, and fail at some step of all. Attributes: steps: of all agents so far. made: agents."""

    def __init__(self, fails_at: int = -1, error: type[BaseException] = KeyboardInterrupt):
        self.steps, self.made, self._fails_at, self._error = 0, 0, fails_at, error

    def __call__(self, env):
        self.made += 1

        def act(state):
            self.steps += 1
            if self.steps == self._fails_at:
                raise self._error("gone")
            return np.zeros((env.num_worlds, *env.action_space.shape), np.float32)

        return act


def test_a_part_is_played_in_batches_of_as_many_as_there_are_worlds():
    part = EpisodePart("elm", (1, 4, 7, 10, 13))
    assert [batch.numbers for batch in batches_of("homes", part, 2)] == [(1, 4), (7, 10), (13,)]
    assert [batch.numbers for batch in batches_of("homes", part, 8)] == [part.numbers]
    assert Batch("homes", part, 2, 2).name == "homes.elm.0000002"


def test_failures_have_the_numbers_of_the_file():
    result = AxisResult("homes", [True, False, False], [1.0, 0.5, 0.0], [1, 4, 7])
    assert result.failures == [(4, 0.5), (7, 0.0)]
    assert AxisResult("homes", [False, True], [0.25, 1.0]).failures == [(0, 0.25)]


class Home:
    """An environment of which nothing is known but whether its engine is pure."""

    num_worlds = 2

    def __init__(self, pure: bool):
        self.pure = pure


class Shown:
    """A stage that notes in `log` when its environment is made, and when its programs are traced and compiled."""

    def __init__(self, name: str, pure: bool, log: list[str]):
        self.axes, self.part, self._name, self._pure, self._log = (name,), EpisodePart(name, (0, 1)), name, pure, log
        self.made: weakref.ref[Home] = weakref.ref(Home(pure))

    def environment(self, options):
        self._log.append(f"{self._name} made{' together' if TOGETHER.active else ''}")
        env = Home(self._pure)
        self.made = weakref.ref(env)
        return env

    def programs(self, env, axis, rows):
        assert env is self.made() and axis == self._name and rows == [0, 1]
        self._log.append(f"{self._name} traced")
        return [self]

    def compiling(self):
        self._log.append(f"{self._name} compiled")
        done = concurrent.futures.Future()
        done.set_result(None)
        return done


class Everything:
    """A ledger of which nothing is over."""

    def pending(self, stage):
        return [Batch(stage.axes[0], stage.part, 0, 2)]


@pytest.mark.parametrize("pure", [True, False], ids=["pure", "native"])
def test_programs_of_pure_engines_are_compiled_side_by_side_before_the_first_is_played(pure):
    """On the native engine there is one environment at a time."""
    log: list[str] = []
    shown = [Shown(name, pure, log) for name in ("a", "b", "c")]
    for stage, env, act in _ready(shown, Everything(), lambda env: lambda state: None, {}):
        assert env is stage.made()
        log.append(f"{stage.axes[0]} played")
        del env, act
    made = ["a made together", "b made together", "c made together"]
    compiled = ["a traced", "a compiled", "b traced", "b compiled", "c traced", "c compiled"]
    one_by_one = ["a made together", "a played", "b made", "b played", "c made", "c played"]
    assert log == ([*made, *compiled, "a played", "b played", "c played"] if pure else one_by_one)
    assert not any(stage.made() for stage in shown), "their memory is free"


@pytest.mark.slow
def test_an_environment_and_its_agent_play_all_axes_that_it_can(book):
    agents, seen = Resting(), []
    done = evaluate_axes(book, AXES, 3, agents, OPTIONS, lambda *a: seen.append(a))
    assert agents.made == 1 and agents.steps == 3 * 2 * 2, "three axes, two batches of two worlds, two steps"
    assert [(r.axis, list(r.numbers), r.success) for r in done.results] == [(a, [0, 1, 2], [False] * 3) for a in AXES]
    shares = [share / total for share, total, _ in seen]
    assert shares == sorted(shares) and shares[-1] == pytest.approx(1.0)
    assert seen[-1][2].startswith("lights: ")


@pytest.mark.slow
def test_what_is_over_is_not_played_again(book):
    store, told = MemoryStore(), []
    cut_off = evaluate_axes(book, AXES, 4, Resting(fails_at=7), OPTIONS, store=store, finished=told.append)
    assert cut_off.interrupted and [r.axis for r in cut_off.results] == ["nominal", "sensor_noise"]
    assert [list(r.numbers) for r in cut_off.results] == [[0, 1, 2, 3], [0, 1]], "of whole batches"
    assert [[r.axis for r in results] for results in told] == [["nominal"]]
    agents = Resting()
    whole = evaluate_axes(book, AXES, 4, agents, OPTIONS, store=store)
    assert not whole.interrupted and agents.steps == 2 * (6 - 3), "of six batches three were over"
    assert result_of(whole.results) == result_of(evaluate_axes(book, AXES, 4, Resting(), OPTIONS).results)
    agents = Resting()
    assert evaluate_axes(book, AXES, 4, agents, OPTIONS, store=store).results == whole.results
    assert not agents.made, "nothing is made where all is over"


@pytest.mark.slow
def test_the_command_goes_on_where_it_was_interrupted(book, tmp_path, capsys):
    """FILE has the axes that are finished; the table what was measured; `--resume` the rest."""
    out = tmp_path / "axes.json"

    def play(agents, **given):
        return play_axes("resting", book, AXES, 2, agents, OPTIONS, Output(out=out, **given), {"agent": "resting"})

    with pytest.raises(KeyboardInterrupt):
        play(Resting(fails_at=4))
    shown = capsys.readouterr()
    assert "nominal" in shown.out and "lights" not in shown.out
    assert "2 episodes are over; the same command with --resume continues" in shown.err
    kept = json.loads(out.read_text())
    assert list(kept["axes"]) == ["nominal"] and kept["unfinished"] == ["sensor_noise", "lights"]
    with pytest.raises(InputError, match="an earlier run was interrupted"):
        play(Resting())
    with pytest.raises(InputError, match=r"had worlds = 2; this one has 1"):
        other = {**OPTIONS, "worlds": 1}
        play_axes("resting", book, AXES, 2, Resting(), other, Output(out=out, resume=True), {"agent": "resting"})
    agents = Resting()
    assert play(agents, resume=True, json=True) == 0 and agents.steps == 4
    found = json.loads(capsys.readouterr().out)
    assert list(found["axes"]) == list(AXES) and "unfinished" not in found
    assert json.loads(out.read_text()) == found and not (tmp_path / "axes.json.jobs").exists()


@pytest.mark.slow
def test_a_server_that_fails_leaves_what_was_measured_and_can_be_resumed(book, tmp_path, capsys):
    out = tmp_path / "axes.json"

    def play(agents, **given):
        return play_axes("resting", book, AXES, 2, agents, OPTIONS, Output(out=out, **given), {"agent": "resting"})

    assert play(Resting(fails_at=4, error=PolicyServerError)) == 1
    assert "error: gone" in capsys.readouterr().err
    kept = json.loads(out.read_text())
    assert kept["error"] == "gone" and kept["axes"]["nominal"]["episodes"] == 2
    assert kept["axes"]["sensor_noise"]["episodes"] == 0 and "lights" not in kept["axes"]
    agents = Resting()
    assert play(agents, resume=True) == 0 and agents.steps == 4
