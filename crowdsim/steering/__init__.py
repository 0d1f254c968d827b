"""Velocity-based steering: each agent sees its neighbors, chooses a velocity and commits a collision-free step."""
