"""YAML files: values with their places, messages, overrides."""
