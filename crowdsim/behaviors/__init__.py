"""Behaviors: their files, sets of them, their clearances."""
