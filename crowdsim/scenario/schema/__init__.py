"""The keys of a scenario file."""
