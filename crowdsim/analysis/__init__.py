"""Measure recordings as researchers of pedestrian dynamics do, by PedPy: it reads recordings only."""
