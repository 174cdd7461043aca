"""Readers: URDF, scene files, metadata, meshes and maps, turned into plain descriptions."""
