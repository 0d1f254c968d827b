"""Numbers that more than one room needs, with their units, once."""

CAPTURE_RATE = 60
"""Frames a second of every clip inside the engine; captures are resampled to it when read."""

NONE = -1
"""The absent index in every int32 index column."""

TRACKING_MARGIN = 0.05
"""Meters a planned clearance exceeds the body's own, so that a motion may stray that far off its path."""

STEERING_RATE = 10
"""Decisions a second of steered characters."""
