"""The humanoid drives between random free places and to random objects of every home, with doors between rooms open."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.planning import execution
from ig2mj.planning.driving import drive
from ig2mj.planning.free_floor import NEAR_START
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.stage import CoreStage
from ig2mj.planning.stances import stances
from ig2mj.planning.starts import open_doors, start_place
from ig2mj.planning.steps import make_step
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.paths import shipped_homes

NOT_VISITED = ("walls", "floors", "ceilings", "door", "window")


class Course:
    """Drives in one home, each from where the one before has ended."""

    def __init__(self, home: str):
        bare = ig2mj.load_scene(home)
        x, y = start_place(bare, SceneQuery(bare).view, [])
        self.scene = ig2mj.load_scene(home, agents=[Humanoid().at(x, y, 0.0)])
        self.stage = CoreStage(self.scene, NativeEngine(self.scene, 1))
        write = open_doors(self.scene)
        if write is not None:
            self.stage.write(write)
        self.planner, self.rung = MotionPlanner(self.scene), PhysicsRung(self.stage)
        self.rng = np.random.default_rng(0)

    def base(self) -> np.ndarray:
        return np.asarray(self.stage.view.agent.base_pos)[0, 0, :2]

    def drives_to_a_random_place(self) -> bool:
        floor = self.planner.floor(self.stage.view)
        cells = np.argwhere(np.isfinite(floor.distances(self.base(), NEAR_START)))
        goal = floor.occupancy.middles(cells[self.rng.integers(len(cells))])
        plan = self.planner.plan_base(self.stage.view, goal)
        if plan.reason:
            return False
        carry = execution.begin([drive(plan.points, None)])
        while carry.running.any():
            action, carry = execution.advance(self.rung.body, 0, carry, self.stage.view)
            self.stage.act(action)
        return not carry.reason(0) and float(np.linalg.norm(self.base() - goal)) < 0.1

    def goes_to_a_random_object(self) -> bool | None:
        """None: the object is out of reach from all floor that can be driven to."""
        tables, world = self.scene.tables, self.rung.world(0)
        kinds, parked = np.array(tables.object_categories), tables.object_parked
        name = tables.object_names[self.rng.choice(np.flatnonzero(~np.isin(kinds, NOT_VISITED) & ~parked))]
        floor, hand = world.floor(), len(world.body.hands) - 1
        points = (world.com(name), *world.rim(name))
        reachable = any(next(stances(world, hand, point, floor, 0.55), None) is not None for point in points)
        self.rung.begin(0, make_step("navigate_to", (name,)))
        outcome = self.rung.advance()[0]
        return outcome.done if reachable else None


def arrivals(home: str, pairs: int) -> list[bool]:
    course = Course(home)
    drives = [course.drives_to_a_random_place() for _ in range(pairs)]
    visits = [course.goes_to_a_random_object() for _ in range(pairs)]
    return drives + [v for v in visits if v is not None]


@pytest.mark.slow
@pytest.mark.parametrize("home", shipped_homes())
def test_the_humanoid_arrives_in_95_of_100_drives(home):
    found = arrivals(home, 10)
    assert len(found) >= 15 and np.mean(found) >= 0.95


@pytest.mark.slow
def test_the_humanoid_arrives_in_a_small_home():
    assert all(arrivals("small_home", 2))


def test_ways_lead_between_all_free_places_of_a_small_home():
    scene = ig2mj.load_scene("small_home", agents=[Humanoid().at(-1.0, 0.0, 0.0)])
    planner, view = MotionPlanner(scene), SceneQuery(scene).view
    floor = planner.floor(view)
    cells = np.argwhere(np.isfinite(floor.distances((-1.0, 0.0), NEAR_START)))
    assert len(cells) > 0.9 * floor.free.sum()
    for goal in floor.occupancy.middles(np.random.default_rng(0).permutation(cells)[:10]):
        plan = planner.plan_base(view, goal)
        assert plan.reason == "" and plan.length >= np.linalg.norm(goal - plan.points[0]) - 0.15
        spare = [floor.nearest(point, 0.06) is not None for point in plan.points[1:]]
        assert all(spare)
