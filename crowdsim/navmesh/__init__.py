"""One clearance layer: triangulation, clearances, paths of any radius."""
