"""Paths led aside for slack and for turns."""
