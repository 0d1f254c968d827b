"""Places: solids, floors, readers of floor plans and mesh files, clearance layers, and random spots."""
