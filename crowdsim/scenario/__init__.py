"""The file that describes a simulation: schema, loader, checks and the placing of characters."""
