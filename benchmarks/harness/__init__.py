"""What the programs share: rows with their provenance, timing in turns, homes to run on."""
