"""Plane geometry with the same bits on every processor: predicates, poses, polygons, elementary functions."""
