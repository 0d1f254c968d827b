"""Scenario files: schema, loader, checks, the environment they describe, and the placement of agents."""
