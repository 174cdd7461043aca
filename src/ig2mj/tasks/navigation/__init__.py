"""Tasks of moving about: navigation to a point, among loose objects and other robots, reaching, closing furniture."""
