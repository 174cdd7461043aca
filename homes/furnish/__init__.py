"""Furnishing: what stands in a room of a kind, and where. `kit.RoomKit` places; the other files hold the rules."""
