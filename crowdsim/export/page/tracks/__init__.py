"""Tracks of a page: chunks of steps, and the code that makes few bytes of them."""
