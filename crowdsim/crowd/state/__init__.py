"""Agents, reserved timelines, the environment, shared assets."""
