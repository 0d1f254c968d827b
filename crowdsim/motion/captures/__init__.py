"""Motion capture files: read, cleaned, retargeted, written."""
