"""The crowd of a run: characters, their levels of locomotion, commands, and measures."""
