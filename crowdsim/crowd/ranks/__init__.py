"""One steered run on several processes (ranks): regions of the floor, and what their ranks exchange."""
