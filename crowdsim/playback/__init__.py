"""Pictures, films and a window of recordings, drawn with VTK."""
