"""The path follower: lays, tests and scores branches."""
