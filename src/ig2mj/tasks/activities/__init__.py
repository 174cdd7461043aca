"""The six activities of the paper's experiments (appendix A.3), one file each: the task, and the plan of its expert.

Every home has at least 60 objects, of which nothing is removed. Robots start where all that an activity needs is within
reach from free floor; where needed, start states are restricted to what is near.
"""

from __future__ import annotations

from ig2mj.tasks.registry import TASKS, load_task
from ig2mj.tasks.task import Task

ACTIVITIES: dict[str, Task] = {name: task for name in TASKS if isinstance(task := load_task(name), Task)}
"""Activities by name, in the paper's order."""
