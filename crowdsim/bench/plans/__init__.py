"""Benchmarks of plans: their time and cost, and whether bodies fit along them."""
