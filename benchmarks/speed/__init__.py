"""Steps per second: one world on one core, batches on a GPU, environments, start-up."""
