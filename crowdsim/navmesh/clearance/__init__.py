"""Distances to obstacles: of points, of swept discs, along ways; and where a disc is free."""
