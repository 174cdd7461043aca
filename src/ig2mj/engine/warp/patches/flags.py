"""Values of `tree_awake` between steps other than 0 and 1; see `ig2mj.engine.warp.patches.resting`."""

FELL_ASLEEP, REPLACED = 2, 3
"""The tree fell asleep in the last step; its world's positions were replaced."""
