"""Bad luck on purpose: edits, files and runs that break, and what comes of them."""
