"""Floor plans: `plan` (rooms, walls, openings), `openings` (where doors and windows go), `shipped` (the homes)."""
