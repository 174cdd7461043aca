"""The same homes in PyBullet, MuJoCo Warp and Genesis."""
