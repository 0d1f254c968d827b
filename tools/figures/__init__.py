"""Figures of docs, each drawn from what the code computes; ``python tools/draw_figures.py`` writes them."""
