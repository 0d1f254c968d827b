"""Bodies as they are shown: of those who steer, and of those who go over between steering and captured motion."""
