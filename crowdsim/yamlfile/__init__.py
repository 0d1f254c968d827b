"""YAML files: values with their positions, error messages, overrides."""
