"""RRT-Connect by OMPL, for ways that neither a straight line nor via points find. Needs the extra `plan`."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable

import numpy as np
from jaxtyping import Float


def is_installed() -> bool:
    """Whether OMPL can be imported."""
    return importlib.util.find_spec("ompl") is not None


def rrt_connect(
    valid: Callable[[Float[np.ndarray, "n"]], bool],
    start: Float[np.ndarray, "n"],
    goal: Float[np.ndarray, "n"],
    low: Float[np.ndarray, "n"],
    high: Float[np.ndarray, "n"],
    resolution: float,
    checks: int,
    seed: int = 1,
) -> Float[np.ndarray, "P n"] | None:
    """Points of a way between two states, whose straight connections are valid; None: none was found.

    Args:
      valid: of a state. low, high: bounds of states. resolution: distance at which connections are checked.
      checks: states that are looked at before it gives up. seed: of OMPL's random numbers, above 0.
    """
    base, geometric, util = (importlib.import_module(f"ompl.{part}") for part in ("base", "geometric", "util"))

    util.noOutputHandler()
    util.RNG.setSeed(seed)
    left = [checks]

    def is_valid(state) -> bool:
        left[0] -= 1
        return bool(valid(np.array([state[i] for i in range(len(start))])))

    space = base.RealVectorStateSpace(len(start))
    bounds = base.RealVectorBounds(len(start))
    for i in range(len(start)):
        bounds.setLow(i, float(low[i]))
        bounds.setHigh(i, float(high[i]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(is_valid)
    setup.getSpaceInformation().setStateValidityCheckingResolution(resolution / space.getMaximumExtent())
    ends = []
    for values in (start, goal):
        state = space.allocState()
        for i, value in enumerate(values):
            state[i] = float(value)
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
    setup.solve(base.PlannerTerminationCondition(lambda: left[0] <= 0))
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    geometric.PathSimplifier(setup.getSpaceInformation()).reduceVertices(path)
    states = path.getStates()
    return np.array([[state[i] for i in range(len(start))] for state in states])
