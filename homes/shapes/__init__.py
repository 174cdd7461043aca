"""Shapes: bricks with visuals and collision hulls, their materials, and where objects can be put on them."""
