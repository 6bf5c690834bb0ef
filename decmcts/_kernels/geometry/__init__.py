"""Shapes: what a head hits, walls, seams, safe travels."""
