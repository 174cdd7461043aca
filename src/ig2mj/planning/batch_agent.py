"""`BatchAgent`: one robot in many worlds of the native engine, which carries out a primitive in all of them.

scene = ig2mj.load_scene("small_home", agents=[Humanoid().at(-1.0, 0.0, 0.0)])
agent = BatchAgent.of_scene(scene, 16, starts=pool)
outcomes = agent.do("grasp", "apple_0")          # one for each world
"""

from __future__ import annotations

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.errors import UnknownNameError
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.stage import CoreStage, Stage
from ig2mj.planning.steps import Outcome, make_step
from ig2mj.process import entry_point
from ig2mj.scene.scene import Scene
from ig2mj.worlds.pool import Pool


@entry_point
class BatchAgent:
    """One robot in many worlds of the native engine, which carries out a primitive in all of them: `of_scene`, `do`.

    Attributes: rung: what carries out its primitives, in the worlds of `rung.stage`.
    """

    def __init__(self, stage: Stage, seed: int = 0):
        """Raises PlanningError: the robot has no base that planned ways can move."""
        self.rung = PhysicsRung(stage, seed)

    @classmethod
    def of_scene(
        cls, scene: Scene, worlds: int = 1, robot: str | None = None, *, starts: Pool | None = None, seed: int = 0
    ) -> BatchAgent:
        """A robot in new worlds of the native engine, whose hands hold by assisted grasps.

        Args:
          scene: with its robots. robot: name of the one that acts; None: the first.
          starts: of the bare scene, a row for each world in turn; None: the scene's own start.
          seed: of what is sampled.

        Raises:
          UnknownNameError: no such robot. PlanningError: as of the class.
        """
        names = scene.tables.agent_names
        if robot is not None and robot not in names:
            raise UnknownNameError("robot", robot, names)
        number = 0 if robot is None else names.index(robot)
        return cls(CoreStage(scene, NativeEngine(scene, worlds), starts=starts, agent=number), seed)

    def do(self, primitive: str, *arguments: str) -> list[Outcome]:
        """Carries out a primitive in all worlds; takes simulated time until the last of them has ended.

        Args:
          primitive: a name of `ig2mj.planning.PRIMITIVES`. arguments: names of objects and rooms.

        Returns:
          How it ended in each world.

        Raises:
          UnknownNameError: no such primitive, object or room. PlanningError: too many or few arguments, or the robot
          lacks what the primitive takes.
        """
        step, found = make_step(primitive, arguments), dict[int, Outcome]()
        self.rung.check(step)
        for world in range(self.rung.num_worlds):
            self.rung.begin(world, step)
        while len(found) < self.rung.num_worlds:
            found |= self.rung.advance()
        return [found[world] for world in range(self.rung.num_worlds)]
