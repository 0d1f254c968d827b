"""What is asked: ends, requirements, behavior areas, bounds."""
