"""What agents perceive."""
