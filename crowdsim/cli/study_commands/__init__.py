"""Commands that study runs: ``crowdsim analyze`` and ``crowdsim sweep``."""
