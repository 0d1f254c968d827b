"""The ``crowdsim motion`` commands."""
