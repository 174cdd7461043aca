"""Requests to processes that plan."""

import multiprocessing
from types import SimpleNamespace

import ig2mj
from ig2mj.envs.planning_processes import PlanningProcesses


class Pipe:
    """An end of a pipe that keeps what was sent."""

    def __init__(self):
        self.sent, (own, self.other) = [], multiprocessing.Pipe()
        self.fileno, self.recv, self.close = own.fileno, own.recv, own.close

    def send(self, request):
        self.sent.append(request[1])


class Process:
    def __init__(self, target, args, daemon):
        self.start = self.join = lambda timeout=None: None
        self.is_alive = lambda: False


def test_a_process_gets_its_next_request_when_it_has_answered(monkeypatch):
    pipes = [Pipe(), Pipe()]
    left = iter(pipes)
    context = SimpleNamespace(Pipe=lambda: (next(left), SimpleNamespace(close=lambda: None)), Process=Process)
    monkeypatch.setattr(multiprocessing, "get_context", lambda kind: context)
    env = SimpleNamespace(config=ig2mj.EnvConfig(), task=SimpleNamespace(name="any"))
    with PlanningProcesses(env, 2) as planners:  # pyright: ignore[reportArgumentType]
        for world in range(5):
            planners.begin(world, world, None)  # pyright: ignore[reportArgumentType]
        assert [pipe.sent for pipe in pipes] == [[0], [1]]
        pipes[0].other.send((0, [], 0.5))
        assert list(planners.answers(wait=True)) == [(0, [])]
        assert [pipe.sent for pipe in pipes] == [[0, 2], [1]]
        assert planners.asked == {1, 2, 3, 4} and planners.seconds == 0.5
    for pipe in pipes:
        pipe.other.close()
