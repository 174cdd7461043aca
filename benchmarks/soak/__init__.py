"""Very many steps under random actions: what is lost, and whether energy grows."""
