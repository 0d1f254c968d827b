"""Shifts of a path for slack and for turns."""
