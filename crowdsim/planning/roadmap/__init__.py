"""The roadmap: made, searched, its ways pulled taut."""
