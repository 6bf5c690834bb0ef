"""Bare sequential ordering problems."""
