"""Statistics of a run and the header of its recording."""
