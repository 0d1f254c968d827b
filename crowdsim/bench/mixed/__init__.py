"""Benchmarks of both levels of locomotion in one crowd."""
