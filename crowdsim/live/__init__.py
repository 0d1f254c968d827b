"""A simulation that is watched and steered in a browser while it runs."""
