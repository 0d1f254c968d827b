"""Poses of bodies at playback: of steered agents, and of agents that switch between steered and captured."""
