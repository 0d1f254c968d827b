"""Behaviors: files, sets, clips and clearances of each."""
