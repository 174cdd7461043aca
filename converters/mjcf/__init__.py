"""MJCF and manifest out of bodies and hulls."""
