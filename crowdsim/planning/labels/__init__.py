"""The cheapest behavior for each section of a path."""
