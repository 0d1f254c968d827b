"""Solids of a place and the clearance layers they leave free."""
