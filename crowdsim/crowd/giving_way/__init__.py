"""Giving way: standing characters move aside for those that walk."""
