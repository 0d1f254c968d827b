"""Motion capture files: read, clean, retarget, write."""
