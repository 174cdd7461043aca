"""Batches of worlds: the pure control step with states, reset from a pool, guards, recording, sharding."""
