"""Tests of evacuation guidelines and measured diagrams: scenarios, criteria, and reports of how they come out."""
