"""Neighbor search of captured agents: rows sorted by cells."""
