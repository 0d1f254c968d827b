"""Tests of evacuation guidelines and measured diagrams: scenarios, criteria, and reports of the results."""
