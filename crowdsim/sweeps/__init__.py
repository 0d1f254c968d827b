"""Sweeps: many runs of one scenario, over seeds and values of its keys."""
