"""Shifts of a path for more clearance and for turns."""
