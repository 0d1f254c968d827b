"""Distances from points, swept discs and ways to obstacles, and the nearest free place of a disc."""
