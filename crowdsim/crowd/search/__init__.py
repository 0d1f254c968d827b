"""Searches for motion, in slices, on worker threads."""
