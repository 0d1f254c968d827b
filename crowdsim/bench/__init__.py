"""Named benchmarks; each measures one subject and returns a table and a flat mapping of figures."""
