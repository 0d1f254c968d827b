"""What the papers compare: standard graphs, error images, sets."""
