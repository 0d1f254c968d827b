"""The roadmap: building it, searching it, pulling paths taut."""
