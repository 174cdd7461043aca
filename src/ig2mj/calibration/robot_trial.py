"""Trials of a converted robot in a home: it stands, drives a metre, and lifts a cube (`try_robot`).

    result = try_robot(UrdfRobot.load("panda"), props)

The robot acts by its own controller. `robot_base_trials` and `robot_lifting` hold the trials.
"""

from __future__ import annotations

import dataclasses
import math

from ig2mj.agents.urdf import UrdfRobot
from ig2mj.calibration.robot_base_trials import DISTANCE, drives, stands
from ig2mj.calibration.robot_lifting import NEEDED, TRIES, PropMaker, Watch, lift, unwatched
from ig2mj.calibration.robot_place import find_place
from ig2mj.errors import EngineError
from ig2mj.scene.scene import load_scene
from ig2mj.simulation import Simulation


@dataclasses.dataclass
class RobotTrial:
    """What a robot did.

    Attributes:
      stands: for five seconds. drives: m in the direction of "forward"; None: it has no wheels.
      lifted, reasons, approach, cube: see `Lifting`; nothing was lifted where it has no gripper. mode: of grasping.
      problem: why a trial could not be made.
    """

    stands: bool = False
    drives: float | None = None
    lifted: list[bool] = dataclasses.field(default_factory=list)
    reasons: list[str] = dataclasses.field(default_factory=list)
    approach: str = ""
    cube: float = 0.0
    mode: str = "physical"
    problem: str = ""

    @property
    def passed(self) -> bool:
        """It stands, drives where it has wheels, and lifts in eight of ten tries where it has a gripper."""
        drives = self.drives is None or self.drives >= DISTANCE
        return self.stands and drives and not self.problem and sum(self.lifted) >= self.needed

    @property
    def needed(self) -> int:
        """Tries that must succeed."""
        return math.ceil(NEEDED * len(self.lifted))


def try_robot(
    robot: UrdfRobot,
    prop: PropMaker,
    home: str = "small_home",
    tries: int = TRIES,
    mode: str = "physical",
    seed: int = 0,
    watch: Watch = unwatched,
) -> RobotTrial:
    """All trials of a robot. prop: makes the cube and its post. watch: is shown the world after each stage of a try."""
    result = RobotTrial(mode=mode)
    placed = find_place(robot, home)
    simulation = Simulation(load_scene(home, agents=[placed]))
    result.stands = stands(simulation, placed)
    if robot.drives:
        simulation.reset()
        result.drives = drives(simulation, placed)
    if robot.layout.grippers or robot.layout.suction:
        try:
            lifting = lift(placed, prop, home, tries, mode, seed, watch)
            result = dataclasses.replace(result, **vars(lifting))
        except EngineError as e:
            result.problem = str(e)
    return result
