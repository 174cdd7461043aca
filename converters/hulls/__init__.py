"""Convex collision pieces out of meshes."""
