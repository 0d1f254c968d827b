"""Motion maps: build them, keep them in files."""
