"""Characters, reserved timelines, the environment, shared assets."""
