"""Motion: captures and clips, motion graphs, motion maps, and clips deformed to tracks."""
