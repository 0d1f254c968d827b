"""Steered characters: the stages of their step, on columns of the world."""
