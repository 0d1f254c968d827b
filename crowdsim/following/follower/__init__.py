"""The path follower: lay, test and score branches along a path."""
