"""The velocity level of the crowd: everyone looks, decides on a velocity, and commits to a step that touches nobody."""
