"""Motion maps: building them, keeping them in files."""
