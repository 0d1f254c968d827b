"""Which behavior where along a path, exactly."""
