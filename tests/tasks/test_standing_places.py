"""Where a robot can stand: contacts within the household play no part."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.navigation.starts import Places, _apart


def test_a_robot_stands_where_none_of_all_contacts_of_the_scene_is_one_of_it_with_more_than_the_ground():
    scene = load_scene("small_home", agents=[TurtleBot()])
    model, places = scene.model, Places(scene, scene.start_data().qpos)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    answers = []
    for _ in range(100):
        pose = (*rng.uniform(-4.0, 4.0, 2).tolist(), 0.0)
        data.qpos[:] = places._start
        data.qpos[places.address[0] : places.address[0] + 7] = places.free_joint(0, pose)
        mujoco.mj_forward(model, data)
        robots = scene.tables.body_agent[model.geom_bodyid[data.contact.geom]] >= 0
        met = data.contact.geom[(robots.any(1) & ~robots.all(1)) & (data.contact.dist <= 0)]
        met = met[~(scene.tables.body_agent[model.geom_bodyid[met]] >= 0)] if met.size else met
        answers.append(bool(places._ground[met].all()))
        assert places.stands(0, pose) == answers[-1]
    assert {True, False} == set(answers)


def test_a_model_that_needs_the_high_bits_of_contact_types_is_left_as_it_is():
    xml = '<mujoco><worldbody><geom size="1" contype="{}"/></worldbody></mujoco>'
    for types, same in ((1 << 20, True), (3, False)):
        model = mujoco.MjModel.from_xml_string(xml.format(types))
        assert (_apart(model, np.zeros(1, bool)) is model) == same
