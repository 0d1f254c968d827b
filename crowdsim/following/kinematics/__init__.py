"""Chains of nodes turned at their joints."""
