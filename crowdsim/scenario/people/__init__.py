"""The characters of a scenario: when they come, where they start and go, and their properties."""
