"""Motions: graphs of them, searches over these, and maps that follow paths."""
