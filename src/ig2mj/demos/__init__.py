"""Recordings of environments: everything of every frame, to be replayed bit for bit (docs/guide/demonstrations.md)."""

from ig2mj.demos.environments import RecordedEnvironment, record
from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.replay import Replayer, replay
from ig2mj.demos.shipped import find_recording, shipped
from ig2mj.process.public_names import offer_modules

__all__ = ["RecordedEnvironment", "Recording", "Replayer", "Run", "find_recording", "record", "replay", "shipped"]

offer_modules(__name__)
