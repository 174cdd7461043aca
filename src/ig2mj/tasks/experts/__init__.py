"""Scripted experts of activities, whose plans are in `tasks/activities`. They show that a task can be done, and label
states.

An expert is a pure, batched function of the present state of the world. It remembers nothing: which part of the task
comes next follows from what is held and where things are. So it can label any state, including states that another
policy has reached."""

from __future__ import annotations

from ig2mj.process.public_names import offer_modules
from ig2mj.tasks.experts.expert import Expert

__all__ = ["Expert"]

offer_modules(__name__)
