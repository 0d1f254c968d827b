"""Systems: the stages of a simulation step."""
