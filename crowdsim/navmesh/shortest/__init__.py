"""Shortest paths of discs: the graph of tangents between corners, and the search on it."""
