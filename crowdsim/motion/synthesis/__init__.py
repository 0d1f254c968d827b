"""Clips made without captures: gaits, turns, dances."""
