"""Bare problems: sequential orderings, and cranes on one rail."""
