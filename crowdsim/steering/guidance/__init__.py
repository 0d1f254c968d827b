"""Guidance: one field per goal gives every agent the direction, the length of its path and the behavior to use."""
