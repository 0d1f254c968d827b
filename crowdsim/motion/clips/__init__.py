"""Skeletons, clips, their tracks and their clearances."""
