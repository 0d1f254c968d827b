"""Exact predicates, planar poses, polygon cleaning."""
