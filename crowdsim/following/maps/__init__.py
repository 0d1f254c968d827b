"""Motion maps: built, walked, kept in files."""
