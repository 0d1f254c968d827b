"""Reports: measures, statistics and recording header of a run."""
