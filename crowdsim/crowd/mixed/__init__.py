"""Captured and steered characters in one place."""
