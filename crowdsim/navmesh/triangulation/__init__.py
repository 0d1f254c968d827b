"""The constrained triangulation: points, segments, refinement, and the mesh of an area built from them."""
