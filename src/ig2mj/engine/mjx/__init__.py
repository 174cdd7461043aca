"""What the two MJX engines share, and the engine on MJX's JAX implementation."""
