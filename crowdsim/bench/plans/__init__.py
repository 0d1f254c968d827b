"""Plans: what they cost and take, and whether bodies pass along them."""
