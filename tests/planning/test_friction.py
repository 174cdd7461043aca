"""What hands hold by friction alone."""

import numpy as np

from ig2mj.planning.senses import FrictionHolds


def test_a_hand_holds_what_two_links_of_its_fingers_press_on():
    holds = FrictionHolds(np.array([0, 0, 1, 1]), np.array([2, 2, 4]), 5, np.array([0, 1]))
    force = np.zeros((1, 4, 3), np.float32)
    force[0, 0, 1] = force[0, 1, 1] = 3.0  # both links of hand 0 on a body of object 2
    force[0, 2, 2] = 3.0  # one link of hand 1 on object 4
    assert np.argwhere(holds(force)).tolist() == [[0, 0, 2]]
