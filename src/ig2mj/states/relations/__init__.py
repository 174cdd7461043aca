"""Relations that several predicates and states read: touching, adjacency, containment, nearness, rooms."""
