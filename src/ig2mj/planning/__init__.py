"""Planning: from a goal to the primitives that reach it, and the motion that carries them out.

`TaskPlanner` plans steps (`Step`) for a goal, a rung (`ig2mj.planning.rung`) carries them out, and `solve` plans again
after each. docs/design/planning.md describes how they fit together.
"""

from ig2mj.planning.batch_agent import BatchAgent
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.kinematic import KinematicRung
from ig2mj.planning.motion_planner import ArmPlan, BasePlan, HandPlan, MotionPlanner
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.problem import Problem, problem_of
from ig2mj.planning.solver import EpisodeResult, StepRecord, solve, summary
from ig2mj.planning.steps import PRIMITIVES, REASONS, Outcome, PlanningError, Step, UnsupportedPrimitive, make_step
from ig2mj.planning.symbolic import SymbolicRung
from ig2mj.planning.task_planner import TaskPlan, TaskPlanner
from ig2mj.process.public_names import offer_modules

__all__ = [
    "PRIMITIVES",
    "REASONS",
    "ArmPlan",
    "BasePlan",
    "BatchAgent",
    "Domain",
    "EpisodeResult",
    "Facts",
    "HandPlan",
    "KinematicRung",
    "MotionPlanner",
    "Outcome",
    "PhysicsRung",
    "PlanningError",
    "Problem",
    "Step",
    "StepRecord",
    "SymbolicRung",
    "TaskPlan",
    "TaskPlanner",
    "UnsupportedPrimitive",
    "make_step",
    "problem_of",
    "solve",
    "summary",
]

offer_modules(__name__)
