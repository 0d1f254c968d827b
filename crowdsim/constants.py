"""Constants that several packages share, with their units."""

CAPTURE_RATE = 60
"""Frames per second of every clip in memory [1/s]. Captures are resampled to this rate when they are read."""

CAPTURE_PATTERNS = ("*.bvh", "*.amc")
"""Patterns of file names: which files in a folder are taken as motion captures."""

NONE = -1
"""Value that stands for "no index" in columns of indices."""

TRACKING_MARGIN = 0.05
"""Extra clearance of planned paths beyond the body's own [m]. A motion may leave its path by this much."""

STEERING_RATE = 10
"""Steering decisions per second of simulated time [1/s]."""
