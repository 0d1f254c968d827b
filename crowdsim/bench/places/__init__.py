"""Benchmarks of environments: triangulation, paths, and import of files."""
