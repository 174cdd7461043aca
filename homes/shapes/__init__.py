"""Shapes: bricks that are seen and collide, their materials, and where objects can be put on them."""
