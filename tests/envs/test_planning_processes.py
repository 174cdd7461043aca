"""Requests to processes that plan."""

import multiprocessing
from types import SimpleNamespace

import numpy as np

import ig2mj
from ig2mj.envs.planning_processes import TOGETHER, PlanningProcesses


class Pipe:
    """An end of a pipe that keeps what was sent."""

    def __init__(self):
        self.sent, (own, self.other) = [], multiprocessing.Pipe()
        self.fileno, self.recv, self.poll, self.close = own.fileno, own.recv, own.poll, own.close

    def send(self, requests):
        self.sent.append([world for _, world, *_ in requests])


class Process:
    def __init__(self, target, args, daemon):
        self.start = self.join = lambda timeout=None: None
        self.is_alive = lambda: False


def test_a_process_gets_its_next_requests_when_it_has_answered_all(monkeypatch):
    """Several at once: with one for each step of the worlds, most of 1,024 hold still while processes rest."""
    pipes = [Pipe(), Pipe()]
    left = iter(pipes)
    other_end = SimpleNamespace(close=lambda: None)
    context = SimpleNamespace(
        Pipe=lambda: (next(left), other_end), Process=Process, RawArray=lambda kind, size: bytearray(size)
    )
    monkeypatch.setattr(multiprocessing, "get_context", lambda kind: context)
    worlds = 2 * TOGETHER + 4
    env = SimpleNamespace(config=ig2mj.EnvConfig(), task=SimpleNamespace(name="any"), num_worlds=worlds)
    with PlanningProcesses(env, 2) as planners:  # pyright: ignore[reportArgumentType]
        planners.keep(range(worlds), np.zeros((worlds, 3)), [np.zeros(worlds)])  # pyright: ignore[reportArgumentType]
        for world in range(worlds):
            planners.begin(world, world)
        assert [pipe.sent for pipe in pipes] == [[[0]], [[1]]]
        pipes[0].other.send((0, [], 0.5))
        assert list(planners.answers(wait=None)) == [(0, [])]
        most = list(range(2, 2 * TOGETHER + 1, 2))
        assert [pipe.sent for pipe in pipes] == [[[0], most], [[1]]]
        assert planners.asked == set(range(1, 2 * TOGETHER + 4)) and planners.seconds == 0.5
        for world in most[:-1]:
            pipes[0].other.send((world, [], 0.0))
        assert [world for world, _ in planners.answers()] == most[:-1] and pipes[0].sent[1:] == [most]
        pipes[0].other.send((most[-1], [], 0.0))
        assert list(planners.answers()) == [(most[-1], [])] and pipes[0].sent[2:] == [[2 * TOGETHER + 2]]
    for pipe in pipes:
        pipe.other.close()
