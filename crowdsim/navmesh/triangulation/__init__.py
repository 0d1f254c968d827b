"""The constrained Delaunay triangulation: points, segments, refinement, and the mesh of an area built from them."""
