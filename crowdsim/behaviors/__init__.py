"""Behaviors: their files, clips, clearances, and motion graph."""
