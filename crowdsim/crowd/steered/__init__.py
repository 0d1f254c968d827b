"""Steered agents of a scenario: entry, errands, parties, exits and steps."""
