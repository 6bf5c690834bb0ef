"""Contours cut so that several heads can share one part, and the sweep that prints them."""
