"""Export recordings to other formats: tables, 3D scenes, web pages."""
