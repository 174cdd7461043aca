"""Extended states stepped from the host, doing no more than the change of the world asks for."""
