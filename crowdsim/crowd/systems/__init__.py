"""What happens in a step, one system a file."""
