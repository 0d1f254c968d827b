"""Captured and steered agents in one place."""
