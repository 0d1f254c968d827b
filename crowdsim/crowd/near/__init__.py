"""Who is near: captured characters sorted by cells."""
