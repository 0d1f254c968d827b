"""The published planner, and collision tests in 3D."""
