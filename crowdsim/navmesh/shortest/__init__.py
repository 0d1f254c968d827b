"""Shortest paths of discs: the graph of tangents between corners, and the search in it."""
