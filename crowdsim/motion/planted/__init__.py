"""Planted feet: when the feet of nodes stand, and how bodies that play them keep their feet in place."""
