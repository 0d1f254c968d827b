"""Steered bodies: one clip per behavior, deformed so that its feet stand on an agent's track."""
