"""Planning: the path and the behavior along it, on the layers of a place."""
