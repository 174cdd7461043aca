"""Tasks of moving about: navigation to a point, among loose things and other robots, reaching, closing furniture."""
