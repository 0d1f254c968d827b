"""Fast paths of discs, and which places they join."""
