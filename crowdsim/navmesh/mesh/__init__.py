"""Arrays of a mesh, steps on half-edges, and binary heaps."""
