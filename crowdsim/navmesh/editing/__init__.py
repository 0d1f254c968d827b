"""Obstacles put into a mesh, moved and taken out again."""
