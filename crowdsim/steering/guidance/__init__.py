"""Guidance for many: one field a goal tells everybody the way, its length, and what the body has to do on it."""
