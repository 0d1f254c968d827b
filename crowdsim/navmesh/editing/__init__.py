"""Obstacles that are inserted into a finished mesh, moved and removed again."""
