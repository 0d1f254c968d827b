"""The arrays of a mesh, half-edges and heaps."""
