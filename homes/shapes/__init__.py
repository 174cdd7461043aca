"""Shapes: bricks that are seen and collide, their materials, and where things can be put on them."""
