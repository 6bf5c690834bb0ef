"""Bare team problems: cranes on one rail."""
