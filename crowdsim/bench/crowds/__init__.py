"""Benchmarks of steered crowds."""
