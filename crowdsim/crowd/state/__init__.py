"""What there is: characters, timelines, the place."""
