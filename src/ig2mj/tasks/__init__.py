"""Tasks: what is to be done in a home, and whether it is."""
