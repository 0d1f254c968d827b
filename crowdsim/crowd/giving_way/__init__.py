"""Giving way: standing agents move aside for those that walk."""
