"""Converters: the iGibson dataset and plain URDF to MJCF."""
