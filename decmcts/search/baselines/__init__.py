"""Planners of the literature, one method each."""
