"""Places: triangulating them, paths through them, and making them from files."""
