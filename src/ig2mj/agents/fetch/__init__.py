"""Fetch, the mobile manipulator of the paper's experiments."""

from ig2mj.agents.fetch.controller import FetchController, FetchState
from ig2mj.agents.fetch.robot import Fetch

__all__ = ["Fetch", "FetchController", "FetchState"]
