"""A* on the motion graph, with collision tests or in channels."""
