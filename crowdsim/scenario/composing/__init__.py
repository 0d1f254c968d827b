"""From the keys of a scenario, read from a file or given in Python, to a checked scenario."""
