"""Which of a run's policies `policy.npz` is: the one with the highest lower bound of its training success.

The last one is often the best, but not where learning collapses late or a run is stopped in a dip. Success is what
reports show: of the last episodes, without those that an expert had a part in. The lower limits of the 95 % confidence
intervals are compared, so that 4 of 4 early episodes count less than 74 of 100.
"""

from __future__ import annotations

import contextlib
import pathlib

from ig2mj.errors import InputError
from ig2mj.learn.evaluate import wilson
from ig2mj.learn.policies import Policy

BEST, LAST = "policy.npz", "policy-last.npz"

SUCCESS = "training_success"
"""Where a policy's card has it; None while no episode has counted."""

COUNTED = "training_episodes"
"""And of how many episodes it is."""


class Best:
    """The two policies in a run's folder, `BEST` and `LAST`."""

    def __init__(self, folder: pathlib.Path, resumed: bool):
        """`resumed`: a policy that is there already is of this run, and stays unless a later one is as good."""
        self.file, self._last = folder / BEST, folder / LAST
        self._success = -1.0
        if resumed and self.file.exists():
            with contextlib.suppress(InputError):  # a broken file: any other is better
                self._success = _success(Policy.load(self.file))

    def offer(self, policy: Policy) -> bool:
        """Writes a policy as the last one, and where none before it was better as the best one; whether it was."""
        policy.save(self._last)
        success = _success(policy)
        if success < self._success:
            return False
        policy.save(self.file)
        self._success = success
        return True


def _success(policy: Policy) -> float:
    success, count = policy.card.get(SUCCESS), round(policy.card.get(COUNTED) or 0)
    return -1.0 if success is None or not count else wilson(round(success * count), count)[0]
