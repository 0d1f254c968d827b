"""Neighbor search of captured characters: rows sorted by cells."""
