"""Scripted experts: one for each of the six activities. They show that a task can be done, and label any state.

An expert is a pure, batched function of what the world is like now. It remembers nothing: which part of the task comes
next follows from what is held and where things are. So it may be asked in any state, also in those that another policy
has come to.
"""

from __future__ import annotations

from ig2mj.process.public_names import offer_modules
from ig2mj.tasks.experts.expert import Expert

__all__ = ["Expert"]

offer_modules(__name__)
