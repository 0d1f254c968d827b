"""Benchmarks of motions: motion graphs, searches on them, and motion maps that follow paths."""
