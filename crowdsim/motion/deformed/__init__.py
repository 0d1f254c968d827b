"""Steered bodies: one clip a behavior, deformed so that its feet stand on the track of an agent."""
