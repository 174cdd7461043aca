"""People in the home: devices, the humanoid that they drive, and images for both eyes (docs/guide/vr.md)."""

from ig2mj.process.public_names import offer_modules
from ig2mj.vr.frames import Hand, PlayArea, Pose, PoseFrame
from ig2mj.vr.mapping import Memory, action_of, robot_of
from ig2mj.vr.sources import PoseSource

__all__ = ["Hand", "Memory", "PlayArea", "Pose", "PoseFrame", "PoseSource", "action_of", "robot_of"]

offer_modules(__name__)
