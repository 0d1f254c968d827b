"""The roadmap: build it, search it, pull paths taut along it."""
