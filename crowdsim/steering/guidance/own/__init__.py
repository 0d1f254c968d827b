"""Ways of single agents."""
