"""Standard graphs, error images and capture sets, for comparison."""
