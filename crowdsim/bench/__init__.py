"""Named benchmarks: each measures one thing and gives a table and a flat map of figures."""
