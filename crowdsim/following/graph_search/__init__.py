"""A* on the motion graph, in the open and in channels."""
