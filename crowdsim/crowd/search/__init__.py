"""Searches for motion, in slices and on threads."""
