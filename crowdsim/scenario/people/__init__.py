"""The agents of a scenario: when they come, where they start and go, and their properties."""
