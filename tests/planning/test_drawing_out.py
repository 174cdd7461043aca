"""What stands below furniture is drawn out before it is raised."""

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid

SETTLES = 2.0
"""s in which what is put down comes to rest."""


@pytest.mark.slow
def test_a_carton_below_a_table_is_drawn_out_and_not_raised_against_it():
    scene = ig2mj.load_scene("small_home", objects=["carton"], agents=[Humanoid().at(0.0, -1.0, 0.0)])
    simulation = ig2mj.Simulation(scene, grasping="assisted")
    table, carton = (scene.object_index(name) for name in ("breakfast_table_0", "carton_0"))
    x, y, _ = np.asarray(simulation.view.object_com)[0, table]
    simulation.set_object_pose("carton_0", (x, y, 0.19))
    simulation.step(count=round(SETTLES / simulation.scene.model.opt.timestep))
    assert simulation.predicate("under", "carton_0", "breakfast_table_0")
    taken = simulation.agent.do("grasp", "carton_0")
    assert taken.done and taken.attempts == 1, taken
    low, high = (np.asarray(a)[0] for a in (simulation.view.aabb_low, simulation.view.aabb_high))
    assert low[carton, 2] > 0.3 and high[carton, 2] > high[table, 2]
    put = simulation.agent.do("place_on_floor", "carton_0", "living_room_0")
    assert put.done, put
