"""YAML files: read, overridden, and told what is wrong."""
