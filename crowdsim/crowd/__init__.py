"""The crowd of a run: agents, their levels of locomotion, commands, and measures."""
